/* SPDX-License-Identifier: MIT */
/**
 * @file current.h
 * A current limit, and a watch on the motors' heat, for every fourth episode. They have random numbers of their own:
 * the other episodes are what they would be if there were none.
 */
#ifndef PARITY_CURRENT_H
#define PARITY_CURRENT_H

#include "omni/robot.h"
#include "random.h"

/** Draw the parameters of an episode; off in three of four. */
void current_draw(random_t *random, uint32_t episode, omni_real_t *values);

#endif
