/* SPDX-License-Identifier: MIT */
/**
 * @file flow.h
 * A sensor of motion over the floor for two of five episodes, with all that can be wrong with one. It has random
 * numbers of its own: the other episodes are what they would be if there were none.
 */
#ifndef PARITY_FLOW_H
#define PARITY_FLOW_H

#include "omni/robot.h"
#include "random.h"
#include "world.h"

/** What can go wrong for some ticks. */
typedef enum flow_trouble_t {
    FLOW_FINE = 0,
    FLOW_SILENT,
    FLOW_STUCK,
    FLOW_NAN,
    FLOW_FAR, /**< ways that do not fit */
    FLOW_MARKED,
    FLOW_TROUBLES
} flow_trouble_t;

typedef struct flow_t {
    random_t random;
    omni_pose_t last; /**< pose at the last reading */
    uint32_t due;     /**< ticks to the next one */
    uint32_t trouble; /**< flow_trouble_t */
    uint32_t left;    /**< readings of it */
} flow_t;

/** Draw the parameters of an episode; off in three of five. */
void flow_draw(flow_t *flow, uint32_t episode, omni_real_t *values);

/** What it shows after a step of the world. */
void flow_read(flow_t *flow, const world_t *world, const omni_robot_config_t *config, omni_inputs_t *inputs);

#endif
