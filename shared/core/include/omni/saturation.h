/* SPDX-License-Identifier: MIT */
/**
 * @file saturation.h Saturation of a wheel vector v that keeps its direction: v * min(1, limit / max_i |v_i|)
 * [report eq. 30]. Why: clipping each wheel by itself would change the direction of motion.
 */
#ifndef OMNI_SATURATION_H
#define OMNI_SATURATION_H

#include "omni/types.h"

/**
 * Scale all `count` values by one factor so that none exceeds `limit` in magnitude.
 * @return the factor, 0 < factor <= 1; 1: not limited. Values that aren't finite, or limit <= 0, zero them all
 *         and return 0.
 */
omni_real_t omni_saturate_direction(omni_real_t *values, uint8_t count, omni_real_t limit);

#endif
