/* SPDX-License-Identifier: MIT */
#include "gyro.h"

#include <math.h>

#include "omni/math.h"

void gyro_draw(gyro_t *gyro, uint32_t episode, omni_real_t *values) {
    random_t *random = &gyro->random;
    const uint32_t axis = 1 + random_below(random, GYRO_AXES);
    const omni_real_t sign = random_chance(random, 500000) ? 1.0f : -1.0f;
    gyro->bias_rad_s = random_between(random, -0.02f, 0.02f);
    gyro->wrong_sign = random_chance(random, 500000);
    values[OMNI_PARAM_GYRO_AXIS] = episode % 3 == 2 ? sign * (omni_real_t)axis : 0.0f;
    values[OMNI_PARAM_GYRO_SCALE] = random_between(random, 0.95f, 1.05f);
    values[OMNI_PARAM_GYRO_ND] = random_between(random, 2e-5f, 4e-4f);
    values[OMNI_PARAM_GYRO_MAX] = random_between(random, 4.0f, 40.0f);
}

static void begin_trouble(gyro_t *gyro) {
    random_t *random = &gyro->random;
    if (gyro->left > 0) {
        --gyro->left;
        return;
    }
    gyro->trouble = GYRO_FINE;
    if (random_chance(random, 1500)) {
        gyro->trouble = 1 + random_below(random, GYRO_TROUBLES - 1);
        gyro->left = 1 + random_below(random, 250);
        gyro->bias_rad_s += gyro->trouble == GYRO_JUMPED ? random_between(random, -0.05f, 0.05f) : 0.0f;
    }
}

void gyro_read(gyro_t *gyro, const world_t *world, const omni_robot_config_t *config, omni_inputs_t *inputs) {
    const int up = config->gyro.axis < 0 ? -config->gyro.axis - 1 : config->gyro.axis - 1;
    const omni_real_t turned = omni_wrap_pi(world->pose.theta - gyro->theta);
    gyro->theta = world->pose.theta;
    inputs->gyro_valid = 0;
    if (up < 0) {
        return;
    }
    begin_trouble(gyro);
    const bool backwards = (config->gyro.axis < 0) != gyro->wrong_sign;
    const omni_real_t rate = turned / config->step_s + gyro->bias_rad_s;
    if (gyro->trouble == GYRO_SILENT) {
        return;
    }
    inputs->gyro_valid = (1u << GYRO_AXES) - 1u;
    for (int axis = 0; axis < GYRO_AXES && gyro->trouble != GYRO_STUCK; ++axis) {
        inputs->gyro_rad_s[axis] = 0.002f * random_normal(&gyro->random);
    }
    if (gyro->trouble != GYRO_STUCK) {
        inputs->gyro_rad_s[up] += backwards ? -rate : rate;
    }
    if (gyro->trouble == GYRO_NAN) {
        inputs->gyro_rad_s[up] = random_chance(&gyro->random, 500000) ? NAN : -INFINITY;
    } else if (gyro->trouble == GYRO_SATURATED) {
        inputs->gyro_rad_s[up] = config->gyro.range_rad_s;
    }
}
