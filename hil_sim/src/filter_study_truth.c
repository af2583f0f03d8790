/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "filter_study_parts.h"
#include "hil_sim/random.h"

enum { STREAM = 0x46494C54, BLOCKS = HIL_FILTER_NORMALS / 4, MOTOR = 0, MEASURED = 8, POSE = 12, FIX = 15 };

void hil_filter_truth_reset(hil_filter_truth_t *truth, const hil_filter_config_t *config, const double *pose, uint64_t seed) {
    memset(truth, 0, sizeof *truth);
    memcpy(truth->pose, pose, sizeof truth->pose);
    truth->seed = seed;
    const double wheels = (double)config->wheels;
    for (uint32_t i = 0; i < config->wheels; i++) {
        const double bearing = 2.0 * HIL_FILTER_PI * ((double)i + 0.5) / wheels;
        truth->to_body[0][i] = -2.0 * sin(bearing) * config->radius_m / wheels;
        truth->to_body[1][i] = 2.0 * cos(bearing) * config->radius_m / wheels;
        truth->to_body[2][i] = config->radius_m / (wheels * config->distance_m);
    }
    for (int part = 0; part < 2; part++) {
        truth->motor_sd[part] = sqrt(config->motor_q[part]);
        truth->pose_sd[part] = sqrt(config->pose_q[part]);
        truth->fix_sd[part] = sqrt(config->fix_r[part]);
    }
    truth->measured_sd = sqrt(config->motor_r);
}

/* eq. 45, corrected: x = A x + B V, before the noise. */
static void advance(const hil_filter_config_t *config, double voltage_V, double *x) {
    const double w = x[0];
    const double i = x[1];
    x[0] = config->motor_a[0][0] * w + config->motor_a[0][1] * i + config->motor_b[0] * voltage_V;
    x[1] = config->motor_a[1][0] * w + config->motor_a[1][1] * i + config->motor_b[1] * voltage_V;
}

void hil_filter_truth_motors(hil_filter_truth_t *truth, const hil_filter_config_t *config, const omni_real_t *voltage_V,
                             uint32_t step) {
    for (uint64_t block = 0; block < BLOCKS; block++) {
        hil_normal4(truth->seed, STREAM, (uint64_t)step * BLOCKS + block, &truth->normal[4 * block]);
    }
    for (uint32_t i = 0; i < config->wheels; i++) {
        advance(config, (double)voltage_V[i], truth->open_loop[i]);
        advance(config, (double)voltage_V[i], truth->motor[i]);
        truth->motor[i][0] += truth->motor_sd[0] * truth->normal[MOTOR + 2 * i];
        truth->motor[i][1] += truth->motor_sd[1] * truth->normal[MOTOR + 2 * i + 1];
        /* eq. 46 */
        truth->measured[i] = truth->motor[i][0] + truth->measured_sd * truth->normal[MEASURED + i];
    }
}

/* eq. 57 with the heading of mid-step; z of eq. 58, of this step or the one before. */
void hil_filter_truth_pose(hil_filter_truth_t *truth, const hil_filter_config_t *config, const omni_real_t *filtered,
                           double *fix) {
    double moved[3] = {0.0, 0.0, 0.0};
    double before[3];
    memcpy(before, truth->pose, sizeof before);
    for (uint32_t i = 0; i < config->wheels; i++) {
        const double speed = config->drive == HIL_FILTER_DRIVE_TRUE ? truth->motor[i][0] : (double)filtered[i];
        for (int axis = 0; axis < 3; axis++) {
            moved[axis] += truth->to_body[axis][i] * speed * config->step_s;
        }
    }
    const double heading = before[2] + 0.5 * moved[2];
    const double sine = sin(heading);
    const double cosine = cos(heading);
    truth->pose[0] += cosine * moved[0] - sine * moved[1];
    truth->pose[1] += sine * moved[0] + cosine * moved[1];
    truth->pose[2] += moved[2];
    for (int axis = 0; axis < 3; axis++) {
        truth->pose[axis] += truth->pose_sd[axis == 2] * truth->normal[POSE + axis];
    }
    hil_filter_truth_fix(truth, config->fix == HIL_FILTER_FIX_FRESH ? truth->pose : before, fix);
}

void hil_filter_truth_fix(const hil_filter_truth_t *truth, const double *pose, double *fix) {
    for (int axis = 0; axis < 3; axis++) {
        fix[axis] = pose[axis] + truth->fix_sd[axis == 2] * truth->normal[FIX + axis];
    }
}

double hil_filter_raw_speed(const hil_filter_config_t *config, const hil_filter_truth_t *truth, uint32_t wheel) {
    return config->raw == HIL_FILTER_RAW_MEASURED ? truth->measured[wheel] : truth->open_loop[wheel][0];
}
