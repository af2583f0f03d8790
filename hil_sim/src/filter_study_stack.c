/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "filter_study_parts.h"

static omni_pose_t to_pose(hil_real_t x, hil_real_t y, hil_real_t theta) {
    const omni_pose_t pose = {(omni_real_t)x, (omni_real_t)y, (omni_real_t)theta};
    return pose;
}

static bool init_kinematics(omni_kinematics_t *kinematics, const hil_filter_config_t *config) {
    omni_kinematics_config_t geometry;
    memset(&geometry, 0, sizeof geometry);
    geometry.wheels = (uint8_t)config->wheels;
    for (uint32_t i = 0; i < config->wheels; i++) {
        geometry.radius_m[i] = (omni_real_t)config->radius_m;
        geometry.distance_m[i] = (omni_real_t)config->distance_m;
        geometry.angle_rad[i] = (omni_real_t)(2.0 * HIL_PI * ((double)i + 0.5) / (double)config->wheels);
    }
    return omni_kinematics_init(kinematics, &geometry) == OMNI_OK;
}

static void init_controller(hil_filter_stack_t *stack, const hil_filter_config_t *config) {
    const float no_limit = 1e30f;
    stack->ismc_config.switching = OMNI_ISMC_SWITCH_SIGN;
    stack->ismc_config.step_s = (omni_real_t)config->step_s;
    for (int axis = 0; axis < OMNI_AXES; axis++) {
        stack->ismc_config.lambda[axis] = (omni_real_t)config->ismc_lambda[axis];
        stack->ismc_config.k[axis] = (omni_real_t)config->ismc_k[axis];
        stack->ismc_config.phi[axis] = 1.0f;
        stack->ismc_config.integral_limit[axis] = no_limit;
    }
    omni_ismc_reset(&stack->ismc);
}

static void init_motor_filters(hil_filter_stack_t *stack, const hil_filter_config_t *config) {
    omni_motor_kf_config_t *kf = &stack->kf_config;
    kf->mode = OMNI_KF_MODE_SPEED;
    kf->step_s = (omni_real_t)config->step_s;
    kf->q_speed = (omni_real_t)config->kf_q[0];
    kf->q_current = (omni_real_t)config->kf_q[1];
    kf->r_speed = (omni_real_t)config->motor_r;
    for (int row = 0; row < 2; row++) {
        kf->model.a[row + 1][1] = (omni_real_t)config->motor_a[row][0];
        kf->model.a[row + 1][2] = (omni_real_t)config->motor_a[row][1];
        kf->model.b[row + 1] = (omni_real_t)config->motor_b[row];
    }
    for (uint32_t i = 0; i < config->wheels; i++) {
        omni_motor_kf_reset(&stack->kf[i], kf);
    }
}

static void init_estimates(hil_filter_stack_t *stack, const hil_filter_config_t *config, const double *pose) {
    const omni_pose_t start = to_pose(pose[0], pose[1], pose[2]);
    for (int f = 0; f < HIL_FILTER_COUNT; f++) {
        const double *q = config->ekf_q[f & 1];
        omni_pose_ekf_config_t *ekf = &stack->ekf_config[f];
        ekf->mode = f < HIL_FILTER_EKF ? OMNI_EKF_MODE_ODOMETRY : OMNI_EKF_MODE_POSE;
        ekf->q_xy = (omni_real_t)q[0];
        ekf->q_theta = (omni_real_t)q[1];
        ekf->r_xy = (omni_real_t)config->fix_r[0];
        ekf->r_theta = (omni_real_t)config->fix_r[1];
        ekf->step_s = (omni_real_t)config->step_s;
        omni_pose_ekf_reset(&stack->ekf[f], ekf, &start, 0.0f, 0.0f);
    }
}

bool hil_filter_stack_reset(hil_filter_stack_t *stack, const hil_filter_config_t *config, const double *pose) {
    memset(stack, 0, sizeof *stack);
    stack->step_us = (uint64_t)(config->step_s * 1e6 + 0.5);
    if (!init_kinematics(&stack->kinematics, config)) {
        return false;
    }
    init_controller(stack, config);
    init_motor_filters(stack, config);
    init_estimates(stack, config, pose);
    return true;
}

void hil_filter_control(hil_filter_stack_t *stack, const hil_filter_config_t *config, const double *reference,
                        const double *rate) {
    const omni_pose_t *estimate = &stack->ekf[config->controlled].pose;
    const omni_pose_t wanted = {(omni_real_t)reference[0], (omni_real_t)reference[1], (omni_real_t)reference[2]};
    const omni_twist_t wanted_rate = {(omni_real_t)rate[0], (omni_real_t)rate[1], (omni_real_t)rate[2]};
    omni_control_terms_t terms;
    const omni_twist_t world =
        omni_ismc_step(&stack->ismc, &stack->ismc_config, estimate, &wanted, &wanted_rate, false, &terms);
    const omni_twist_t body = omni_twist_to_body(&world, estimate->theta);
    omni_kinematics_inverse(&stack->kinematics, &body, NULL, stack->voltage);
}

void hil_filter_motors(hil_filter_stack_t *stack, const hil_filter_config_t *config, const hil_real_t *measured) {
    for (uint32_t i = 0; i < config->wheels; i++) {
        stack->filtered[i] =
            omni_motor_kf_step_speed(&stack->kf[i], &stack->kf_config, stack->voltage[i], (omni_real_t)measured[i]);
    }
}

void hil_filter_estimate(hil_filter_stack_t *stack, const hil_filter_config_t *config, const hil_filter_truth_t *truth,
                         hil_real_t *fix, uint32_t step) {
    const uint64_t now_us = ((uint64_t)step + 2) * stack->step_us;
    const uint64_t late_us = config->fix == HIL_FILTER_FIX_LATE ? stack->step_us : 0;
    omni_real_t turned[2][OMNI_MAX_WHEELS];
    memset(turned, 0, sizeof turned);
    for (uint32_t i = 0; i < config->wheels; i++) {
        turned[0][i] = (omni_real_t)(hil_filter_raw_speed(config, truth, i) * config->step_s);
        turned[1][i] = (omni_real_t)((hil_real_t)stack->filtered[i] * config->step_s);
    }
    omni_pose_fix_t measured;
    memset(&measured, 0, sizeof measured);
    measured.time_us = now_us - late_us;
    for (int f = 0; f < HIL_FILTER_COUNT; f++) {
        omni_pose_ekf_state_t *ekf = &stack->ekf[f];
        omni_pose_ekf_predict(ekf, &stack->ekf_config[f], &stack->kinematics, turned[f & 1], now_us);
        if (f < HIL_FILTER_EKF) {
            continue;
        }
        if (config->fix == HIL_FILTER_FIX_OWN) {
            const hil_real_t own[3] = {(hil_real_t)ekf->pose.x, (hil_real_t)ekf->pose.y, (hil_real_t)ekf->pose.theta};
            hil_filter_truth_fix(truth, own, fix);
        }
        measured.pose = to_pose(fix[0], fix[1], fix[2]);
        omni_pose_ekf_correct(ekf, &stack->ekf_config[f], &stack->kinematics, &measured);
    }
}

omni_real_t hil_filter_motor_nis(const hil_filter_stack_t *stack, uint32_t wheels) {
    omni_real_t sum = 0.0f;
    for (uint32_t i = 0; i < wheels; i++) {
        const omni_real_t innovation = stack->kf[i].innovation;
        sum += innovation * innovation / stack->kf[i].innovation_variance;
    }
    return sum / (omni_real_t)wheels;
}
