/* SPDX-License-Identifier: MIT */
/** @file draw.h  Random parameter sets, set-points and waypoints. */
#ifndef PARITY_DRAW_H
#define PARITY_DRAW_H

#include "omni/robot.h"
#include "random.h"

/** How far a set may be from its robot's own. */
typedef enum draw_style_t {
    DRAW_OWN = 0, /**< the robot's values */
    DRAW_NEAR,    /**< some of them up to twice or half */
    DRAW_ANYWHERE /**< some of them anywhere in their range, its ends included */
} draw_style_t;

/** Fill `values` for a robot: OMNI_PARAM_COUNT. The modules in use and a lively path are drawn too; `number` makes sure
 * that each gets its turn. The set may still be refused as a whole. */
void draw_parameters(random_t *random, uint32_t number, draw_style_t style, omni_real_t *values);

/** Change up to three parameters that are not locked while armed. */
void draw_change(random_t *random, omni_real_t *values);

/** A set-point of any kind, near `at`; now and then far away. */
void draw_setpoint(random_t *random, const omni_pose_t *at, omni_setpoint_t *setpoint);

void draw_waypoints(random_t *random, omni_waypoints_t *waypoints);

#endif
