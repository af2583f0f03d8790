/* SPDX-License-Identifier: MIT */
/** @file core_estimators.c  Ours: the control core's filters, as the robot calls them. */
#include <string.h>

#include "estimators.h"
#include "omni/motor_kf.h"
#include "omni/pose_ekf.h"

static omni_kinematics_t kinematics_of(const bench_model_t *model) {
    omni_kinematics_config_t geometry = {.wheels = BENCH_WHEELS};
    for (int i = 0; i < BENCH_WHEELS; i++) {
        geometry.radius_m[i] = model->radius_m;
        geometry.distance_m[i] = model->distance_m;
        geometry.angle_rad[i] = 1.57079633f * ((float)i + 0.5f);
    }
    omni_kinematics_t k;
    (void)omni_kinematics_init(&k, &geometry);
    return k;
}

void core_pose(const bench_model_t *model, const bench_input_t *inputs, uint32_t steps, bench_output_t *output) {
    static omni_pose_ekf_state_t state;
    const omni_kinematics_t k = kinematics_of(model);
    const omni_pose_ekf_config_t config = {.mode = OMNI_EKF_MODE_POSE,
                                           .q_xy = model->pose_q[0],
                                           .q_theta = model->pose_q[2],
                                           .r_xy = model->fix_r[0],
                                           .r_theta = model->fix_r[2],
                                           .step_s = model->step_s};
    const omni_pose_t origin = {0.0f, 0.0f, 0.0f};
    const uint64_t step_us = (uint64_t)(model->step_s * 1e6f + 0.5f);
    omni_pose_ekf_reset(&state, &config, &origin, 0.0f, 0.0f);
    for (uint32_t n = 0; n < steps; n++) {
        const float *fix = inputs[n].fix;
        const omni_pose_fix_t measured = {.time_us = (n + 2) * step_us, .pose = {fix[0], fix[1], fix[2]}};
        omni_pose_ekf_predict(&state, &config, &k, inputs[n].turned_rad, measured.time_us);
        (void)omni_pose_ekf_correct(&state, &config, &k, &measured);
    }
    output->pose[0] = state.pose.x;
    output->pose[1] = state.pose.y;
    output->pose[2] = state.pose.theta;
    for (int a = 0; a < 3; a++) {
        memcpy(output->pose_p[a], state.p[a], sizeof output->pose_p[a]);
    }
}

void core_motor(const bench_model_t *model, const bench_input_t *inputs, uint32_t steps, bench_output_t *output) {
    omni_motor_kf_state_t state;
    omni_motor_kf_config_t config = {.mode = OMNI_KF_MODE_SPEED,
                                     .step_s = model->step_s,
                                     .q_speed = model->motor_q[0],
                                     .q_current = model->motor_q[1],
                                     .r_speed = model->motor_r};
    for (int row = 0; row < 2; row++) {
        config.model.a[row + 1][1] = model->motor_a[row][0];
        config.model.a[row + 1][2] = model->motor_a[row][1];
        config.model.b[row + 1] = model->motor_b[row];
    }
    omni_motor_kf_reset(&state, &config);
    for (uint32_t n = 0; n < steps; n++) {
        (void)omni_motor_kf_step_speed(&state, &config, inputs[n].voltage_V, inputs[n].speed_rad_s);
    }
    for (int row = 0; row < 2; row++) {
        output->motor[row] = state.x[row + 1];
        output->motor_p[row][0] = state.p[row + 1][1];
        output->motor_p[row][1] = state.p[row + 1][2];
    }
}
