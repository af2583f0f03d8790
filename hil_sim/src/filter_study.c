/* SPDX-License-Identifier: MIT */
#include "hil_sim/filter_study.h"

#include <string.h>

#include "filter_study_parts.h"

/* The wheels as the filters see them: speeds of this step, by source. */
enum { SOURCES = 2 };

typedef struct study_t {
    const hil_filter_config_t *config;
    hil_filter_truth_t truth;
    hil_filter_stack_t stack;
    double square[HIL_FILTER_COUNT][3];
    double tracking[3];
    double nis[SOURCES];
    double motor_nis;
    uint32_t closer[HIL_FILTER_COUNT];
} study_t;

static double wrapped(double angle) {
    return remainder(angle, 2.0 * HIL_FILTER_PI);
}

static void error_of(const omni_pose_t *estimate, const double *pose, double *error) {
    error[0] = (double)estimate->x - pose[0];
    error[1] = (double)estimate->y - pose[1];
    error[2] = wrapped((double)estimate->theta - pose[2]);
}

static double square_sum(double x, double y) {
    return x * x + y * y;
}

/* Sums of this step's errors. `reference` is where the robot should be at the end of the step. */
static void gather(study_t *study, const double *reference) {
    const double *pose = study->truth.pose;
    const double distance = square_sum(pose[0], pose[1]);
    for (int f = 0; f < HIL_FILTER_COUNT; f++) {
        const omni_pose_t *estimate = &study->stack.ekf[f].pose;
        double error[3];
        error_of(estimate, pose, error);
        for (int axis = 0; axis < 3; axis++) {
            study->square[f][axis] += error[axis] * error[axis];
        }
        study->closer[f] += square_sum((double)estimate->x, (double)estimate->y) < distance;
    }
    for (int axis = 0; axis < 3; axis++) {
        const double off = axis == 2 ? wrapped(pose[2] - reference[2]) : pose[axis] - reference[axis];
        study->tracking[axis] += off * off;
    }
    for (int source = 0; source < SOURCES; source++) {
        study->nis[source] += (double)study->stack.ekf[HIL_FILTER_EKF + source].nis;
    }
    study->motor_nis += hil_filter_motor_nis(&study->stack, study->config->wheels);
}

static void record(const study_t *study, const double *fix, hil_filter_sample_t *sample) {
    memset(sample, 0, sizeof *sample);
    memcpy(sample->truth, study->truth.pose, sizeof sample->truth);
    memcpy(sample->fix, fix, sizeof sample->fix);
    for (int f = 0; f < HIL_FILTER_COUNT; f++) {
        const omni_pose_t *pose = &study->stack.ekf[f].pose;
        sample->estimate[f][0] = (double)pose->x;
        sample->estimate[f][1] = (double)pose->y;
        sample->estimate[f][2] = (double)pose->theta;
    }
    for (uint32_t i = 0; i < study->config->wheels; i++) {
        sample->voltage_V[i] = (double)study->stack.voltage[i];
        sample->wheel_true[i] = study->truth.motor[i][0];
        sample->wheel_measured[i] = study->truth.measured[i];
        sample->wheel_raw[i] = hil_filter_raw_speed(study->config, &study->truth, i);
        sample->wheel_filtered[i] = (double)study->stack.filtered[i];
    }
}

static void finish(const study_t *study, hil_filter_result_t *result) {
    const double steps = (double)study->config->steps;
    for (int f = 0; f < HIL_FILTER_COUNT; f++) {
        for (int axis = 0; axis < 3; axis++) {
            result->rmse[f][axis] = sqrt(study->square[f][axis] / steps);
        }
        result->closer[f] = study->closer[f] / steps;
        error_of(&study->stack.ekf[f].pose, study->truth.pose, result->final_error[f]);
    }
    for (int source = 0; source < SOURCES; source++) {
        result->nis[source] = study->nis[source] / steps;
        for (int a = 0; a < 3; a++) {
            for (int b = 0; b < 3; b++) {
                result->final_p[source][a][b] = (double)study->stack.ekf[HIL_FILTER_EKF + source].p[a][b];
            }
        }
    }
    result->motor_nis = study->motor_nis / steps;
    for (int axis = 0; axis < 3; axis++) {
        result->tracking[axis] = sqrt(study->tracking[axis] / steps);
    }
}

static bool in_range(const hil_filter_config_t *config) {
    return config->steps > 0 && config->step_s > 0.0 && config->step_s <= 1.0 && (config->wheels == 3 || config->wheels == 4) &&
           config->controlled < HIL_FILTER_COUNT && config->drive <= HIL_FILTER_DRIVE_ESTIMATE &&
           config->raw <= HIL_FILTER_RAW_OPEN_LOOP && config->fix <= HIL_FILTER_FIX_OWN;
}

int32_t hil_filter_study(const hil_filter_config_t *config, const double *reference, const double *rate, uint64_t seed,
                         hil_filter_result_t *result, hil_filter_sample_t *samples) {
    study_t study = {.config = config};
    if (!in_range(config) || !hil_filter_stack_reset(&study.stack, config, reference)) {
        return -1;
    }
    hil_filter_truth_reset(&study.truth, config, reference, seed);
    for (uint32_t step = 0; step < config->steps; step++) {
        double fix[3];
        hil_filter_control(&study.stack, config, reference + 3 * (size_t)step, rate + 3 * (size_t)step);
        hil_filter_truth_motors(&study.truth, config, study.stack.voltage, step);
        hil_filter_motors(&study.stack, config, study.truth.measured);
        hil_filter_truth_pose(&study.truth, config, study.stack.filtered, fix);
        hil_filter_estimate(&study.stack, config, &study.truth, fix, step);
        gather(&study, reference + 3 * ((size_t)step + 1));
        if (samples != NULL) {
            record(&study, fix, &samples[step]);
        }
    }
    finish(&study, result);
    return 0;
}
