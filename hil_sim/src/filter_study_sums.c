/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "filter_study_parts.h"

/* The EKFs that take fixes. */
enum { SOURCES = 2 };

static void error_of(const omni_pose_t *estimate, const hil_real_t *pose, hil_real_t *error) {
    error[0] = (hil_real_t)estimate->x - pose[0];
    error[1] = (hil_real_t)estimate->y - pose[1];
    error[2] = hil_wrap((hil_real_t)estimate->theta - pose[2]);
}

static hil_real_t square_sum(hil_real_t x, hil_real_t y) {
    return x * x + y * y;
}

/* Sums of this step's errors. `reference` is where the robot should be at the end of the step. */
static void gather(hil_filter_run_t *run, const hil_filter_config_t *config, const double *reference) {
    hil_filter_sums_t *sums = &run->sums;
    const hil_real_t *pose = run->truth.pose;
    const hil_real_t distance = square_sum(pose[0], pose[1]);
    for (int f = 0; f < HIL_FILTER_COUNT; f++) {
        const omni_pose_t *estimate = &run->stack.ekf[f].pose;
        hil_real_t error[3];
        error_of(estimate, pose, error);
        for (int axis = 0; axis < 3; axis++) {
            sums->square[f][axis] += error[axis] * error[axis];
        }
        const hil_real_t reach = square_sum((hil_real_t)estimate->x, (hil_real_t)estimate->y);
        sums->closer[f] += hil_select(reach < distance, 1.0, 0.0);
    }
    const hil_real_t off[3] = {pose[0] - reference[0], pose[1] - reference[1], hil_wrap(pose[2] - reference[2])};
    for (int axis = 0; axis < 3; axis++) {
        sums->tracking[axis] += off[axis] * off[axis];
    }
    for (int source = 0; source < SOURCES; source++) {
        sums->nis[source] += (hil_real_t)run->stack.ekf[HIL_FILTER_EKF + source].nis;
    }
    sums->motor_nis += (hil_real_t)hil_filter_motor_nis(&run->stack, config->wheels);
}

bool hil_filter_begin(hil_filter_run_t *run, const hil_filter_config_t *config, const double *reference,
                      const omni_uint_t *seed) {
    memset(&run->sums, 0, sizeof run->sums);
    hil_filter_truth_reset(&run->truth, config, reference, seed);
    return hil_filter_stack_reset(&run->stack, config, reference);
}

void hil_filter_step(hil_filter_run_t *run, const hil_filter_config_t *config, const double *reference,
                     const double *rate, uint32_t step, hil_real_t *fix) {
    const double *wanted = reference + 3 * (size_t)step;
    hil_filter_control(&run->stack, config, wanted, rate + 3 * (size_t)step);
    hil_filter_truth_motors(&run->truth, config, run->stack.voltage, step);
    hil_filter_motors(&run->stack, config, run->truth.measured);
    hil_filter_truth_pose(&run->truth, config, run->stack.filtered, fix);
    hil_filter_estimate(&run->stack, config, &run->truth, fix, step);
    gather(run, config, wanted + 3);
}

void hil_filter_end(hil_filter_run_t *run) {
    for (int f = 0; f < HIL_FILTER_COUNT; f++) {
        error_of(&run->stack.ekf[f].pose, run->truth.pose, run->sums.final_error[f]);
    }
    for (int source = 0; source < SOURCES; source++) {
        for (int a = 0; a < 3; a++) {
            for (int b = 0; b < 3; b++) {
                run->sums.final_p[source][a][b] = (hil_real_t)run->stack.ekf[HIL_FILTER_EKF + source].p[a][b];
            }
        }
    }
}
