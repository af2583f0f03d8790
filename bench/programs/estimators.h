/* SPDX-License-Identifier: MIT */
/**
 * @file estimators.h
 * One step of the robot's two Kalman filters, as ours and the peers offer it. These are the pose EKF of three states
 * with a fix in every step (eq. 57-69), and the motor filter of two states (eq. 45-56). Each candidate runs a sequence
 * of inputs and leaves its last state.
 */
#ifndef BENCH_ESTIMATORS_H
#define BENCH_ESTIMATORS_H

#include <stdint.h>

enum { BENCH_WHEELS = 4 };

typedef struct bench_model_t {
    float step_s;
    float radius_m;
    float distance_m;
    float to_body[3][BENCH_WHEELS]; /**< angle turned [rad] -> displacement in the body's frame [m, m, rad] */
    float pose_q[3];                /**< variances per step */
    float fix_r[3];                 /**< variances of a fix */
    float motor_a[2][2];            /**< (w, i) of the next step */
    float motor_b[2];
    float motor_q[2];
    float motor_r;
} bench_model_t;

typedef struct bench_input_t {
    float turned_rad[BENCH_WHEELS];
    float fix[3]; /**< m, m, rad; the heading stays within half a turn */
    float voltage_V;
    float speed_rad_s;
} bench_input_t;

typedef struct bench_output_t {
    float pose[3];
    float pose_p[3][3];
    float motor[2];
    float motor_p[2][2];
} bench_output_t;

typedef void bench_run_t(const bench_model_t *model, const bench_input_t *inputs, uint32_t steps,
                         bench_output_t *output);

/* The names are those that callgrind is told: C linkage, never inlined. */
#ifdef __cplusplus
extern "C" {
#endif
bench_run_t core_pose, core_motor, tiny_pose, tiny_motor, eigen_pose, eigen_motor, eigen_late_pose;
#ifdef __cplusplus
}
#endif

#endif
