/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "filter_study_parts.h"
#include "normal.h"

enum { STREAM = 0x46494C54, BLOCK = 4, BLOCKS = (HIL_FILTER_NORMALS + BLOCK - 1) / BLOCK };
enum { MOTOR = 0, MEASURED = 8, POSE = 12, FIX = 15 };

void hil_filter_truth_reset(hil_filter_truth_t *truth, const hil_filter_config_t *config, const double *pose,
                            const omni_uint_t *seed) {
    memset(truth->motor, 0, sizeof truth->motor);
    memset(truth->open_loop, 0, sizeof truth->open_loop);
    truth->seed[0] = seed[0];
    truth->seed[1] = seed[1];
    for (int axis = 0; axis < 3; axis++) {
        truth->pose[axis] = pose[axis];
    }
    const double wheels = (double)config->wheels;
    const double rolled = config->radius_m * config->step_s / wheels;
    for (uint32_t i = 0; i < config->wheels; i++) {
        const double bearing = 2.0 * HIL_PI * ((double)i + 0.5) / wheels;
        truth->to_move[0][i] = -2.0 * sin(bearing) * rolled;
        truth->to_move[1][i] = 2.0 * cos(bearing) * rolled;
        truth->to_move[2][i] = rolled / config->distance_m;
    }
    for (int part = 0; part < 2; part++) {
        truth->motor_sd[part] = sqrt(config->motor_q[part]);
        truth->pose_sd[part] = sqrt(config->pose_q[part]);
        truth->fix_sd[part] = sqrt(config->fix_r[part]);
    }
    truth->measured_sd = sqrt(config->motor_r);
}

static void draw_noise(hil_filter_truth_t *truth, uint32_t step) {
    for (int block = 0; block < BLOCKS; block++) {
        omni_uint_t word[BLOCK];
        hil_draw(truth->seed, STREAM, (uint64_t)step * BLOCKS + (uint64_t)block, HIL_KIND_NORMALS, word);
        for (int pair = 0; pair < BLOCK && BLOCK * block + pair < HIL_FILTER_NORMALS; pair += 2) {
            hil_normal_pair(word[pair], word[pair + 1], &truth->normal[BLOCK * block + pair]);
        }
    }
}

/* eq. 45, corrected: x = A x + B V, before the noise. */
static void advance(const hil_filter_config_t *config, hil_real_t voltage_V, hil_real_t *x) {
    const hil_real_t w = x[0];
    const hil_real_t i = x[1];
    x[0] = config->motor_a[0][0] * w + config->motor_a[0][1] * i + config->motor_b[0] * voltage_V;
    x[1] = config->motor_a[1][0] * w + config->motor_a[1][1] * i + config->motor_b[1] * voltage_V;
}

void hil_filter_truth_motors(hil_filter_truth_t *truth, const hil_filter_config_t *config, const omni_real_t *voltage_V,
                             uint32_t step) {
    draw_noise(truth, step);
    for (uint32_t i = 0; i < config->wheels; i++) {
        const hil_real_t voltage = (hil_real_t)voltage_V[i];
        if (config->raw == HIL_FILTER_RAW_OPEN_LOOP) {
            advance(config, voltage, truth->open_loop[i]);
        }
        advance(config, voltage, truth->motor[i]);
        truth->motor[i][0] += truth->motor_sd[0] * (hil_real_t)truth->normal[MOTOR + 2 * i];
        truth->motor[i][1] += truth->motor_sd[1] * (hil_real_t)truth->normal[MOTOR + 2 * i + 1];
        /* eq. 46 */
        truth->measured[i] = truth->motor[i][0] + truth->measured_sd * (hil_real_t)truth->normal[MEASURED + i];
    }
}

/* eq. 57 with the heading of mid-step; z of eq. 58, of this step or the one before. */
void hil_filter_truth_pose(hil_filter_truth_t *truth, const hil_filter_config_t *config, const omni_real_t *filtered,
                           hil_real_t *fix) {
    hil_real_t moved[3] = {0.0, 0.0, 0.0};
    const hil_real_t before[3] = {truth->pose[0], truth->pose[1], truth->pose[2]};
    for (uint32_t i = 0; i < config->wheels; i++) {
        const hil_real_t speed = config->drive == HIL_FILTER_DRIVE_TRUE ? truth->motor[i][0] : (hil_real_t)filtered[i];
        for (int axis = 0; axis < 3; axis++) {
            moved[axis] += truth->to_move[axis][i] * speed;
        }
    }
    hil_real_t turn[2]; /* cosine, sine */
    hil_cos_sin(before[2] + 0.5 * moved[2], turn);
    truth->pose[0] += turn[0] * moved[0] - turn[1] * moved[1];
    truth->pose[1] += turn[1] * moved[0] + turn[0] * moved[1];
    truth->pose[2] += moved[2];
    for (int axis = 0; axis < 3; axis++) {
        truth->pose[axis] += truth->pose_sd[axis == 2] * (hil_real_t)truth->normal[POSE + axis];
    }
    hil_filter_truth_fix(truth, config->fix == HIL_FILTER_FIX_FRESH ? truth->pose : before, fix);
}

void hil_filter_truth_fix(const hil_filter_truth_t *truth, const hil_real_t *pose, hil_real_t *fix) {
    for (int axis = 0; axis < 3; axis++) {
        fix[axis] = pose[axis] + truth->fix_sd[axis == 2] * (hil_real_t)truth->normal[FIX + axis];
    }
}

hil_real_t hil_filter_raw_speed(const hil_filter_config_t *config, const hil_filter_truth_t *truth, uint32_t wheel) {
    return config->raw == HIL_FILTER_RAW_MEASURED ? truth->measured[wheel] : truth->open_loop[wheel][0];
}
