/* SPDX-License-Identifier: MIT */
/**
 * @file gyro.h
 * A gyro for every third episode, with all that can be wrong with one. It has random numbers of its own: episodes
 * without a gyro are what they would be if there were none.
 */
#ifndef PARITY_GYRO_H
#define PARITY_GYRO_H

#include "omni/robot.h"
#include "random.h"
#include "world.h"

enum { GYRO_AXES = 3 };

/** What can go wrong for some ticks. */
typedef enum gyro_trouble_t {
    GYRO_FINE = 0,
    GYRO_SILENT,
    GYRO_STUCK,
    GYRO_NAN,
    GYRO_SATURATED,
    GYRO_JUMPED, /**< its bias: for good */
    GYRO_TROUBLES
} gyro_trouble_t;

typedef struct gyro_t {
    random_t random;
    omni_real_t theta; /**< heading of the tick before */
    omni_real_t bias_rad_s;
    bool wrong_sign;
    uint32_t trouble; /**< gyro_trouble_t */
    uint32_t left;    /**< ticks of it */
} gyro_t;

/** Draw the parameters of an episode; off in two of three. */
void gyro_draw(gyro_t *gyro, uint32_t episode, omni_real_t *values);

/** What it shows after a step of the world. */
void gyro_read(gyro_t *gyro, const world_t *world, const omni_robot_config_t *config, omni_inputs_t *inputs);

#endif
