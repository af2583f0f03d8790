/* SPDX-License-Identifier: MIT */
#include "omni/robot.h"

#include <string.h>

#include "../math/math_inline.h"
#include "robot_internal.h"

void omni_robot_init(omni_robot_t *robot, const omni_robot_config_t *config) {
    const omni_pose_t origin = {0.0f, 0.0f, 0.0f};
    memset(robot, 0, sizeof *robot);
    robot->config = config;
    robot->state = OMNI_STATE_INIT;
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        omni_motor_kf_reset(&robot->motor_kf[i], &config->motor_kf);
    }
    omni_pose_ekf_reset(&robot->pose_ekf, &config->pose_ekf, &origin, omni_sqrtf(config->pose_ekf.r_xy),
                        omni_sqrtf(config->pose_ekf.r_theta));
    omni_ismc_reset(&robot->ismc);
    omni_fl_reset(&robot->fl);
    omni_original_reset(&robot->original);
    omni_wheel_speed_reset(&robot->wheel_speed);
    robot->last_controller = config->controller;
}

void omni_robot_set_config(omni_robot_t *robot, const omni_robot_config_t *config) {
    robot->config = config;
}

/* Last line of defence: what is not finite or not wanted never leaves the tick. */
static void seal(omni_robot_t *robot, omni_tick_t *tick) {
    omni_outputs_t *out = tick->out;
    const bool finite = omni_all_finite(out->duty, OMNI_MAX_WHEELS);
    if (!finite) {
        tick->faults |= OMNI_FAULT_NOT_FINITE;
        robot->fault_history |= OMNI_FAULT_NOT_FINITE;
        robot->state = omni_safety_next(robot->state, OMNI_SAFETY_FAULT);
    }
    out->drive = finite && robot->state == OMNI_STATE_ARMED;
    /*@ split out->drive; */
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        const omni_real_t duty = out->drive ? omni_clampf(out->duty[i], -1.0f, 1.0f) : 0.0f;
        out->voltage_V[i] = duty * out->supply_V;
        robot->last_voltage_V[i] = out->voltage_V[i];
        /* from the wheel's direction to the motor's */
        out->duty[i] = robot->config->motor_direction[i] < 0 ? -duty : duty;
    }
}

/* A filter that has met a number it cannot digest starts over instead of staying lost. */
static void heal(omni_robot_t *robot, const omni_tick_t *tick) {
    const omni_robot_config_t *c = robot->config;
    const bool finite = omni_all_finite(tick->out->wheel_rad_s, c->kinematics.wheels);
    for (uint8_t i = 0; !finite && i < c->kinematics.wheels; ++i) {
        if (!omni_is_finite(tick->out->wheel_rad_s[i])) {
            omni_motor_kf_reset(&robot->motor_kf[i], &c->motor_kf);
        }
    }
    if (!omni_pose_is_finite(&tick->out->pose)) {
        const omni_pose_t origin = {0.0f, 0.0f, 0.0f};
        omni_pose_ekf_reset(&robot->pose_ekf, &c->pose_ekf, &origin, c->limits.position_m, OMNI_PI_F);
    }
}

void omni_robot_tick(omni_robot_t *robot, const omni_inputs_t *inputs, omni_outputs_t *outputs) {
    omni_tick_t tick; /* per wheel: as many entries as there are wheels */
    memset(outputs, 0, sizeof *outputs);
    tick.in = inputs;
    tick.out = outputs;
    tick.faults = 0;
    tick.kind = OMNI_SETPOINT_NONE;
    tick.position_loop = false;
    tick.body_rate = (omni_twist_t){0.0f, 0.0f, 0.0f};
    omni_robot_estimate(robot, &tick);
    omni_robot_supervise(robot, &tick);
    omni_robot_transition(robot, &tick);
    omni_robot_reference(robot, &tick);
    omni_robot_control(robot, &tick);
    omni_robot_gain_margin(robot, &tick);
    seal(robot, &tick);
    heal(robot, &tick);
    robot->last_controller = robot->config->controller;
    robot->last_kind = tick.kind;
    outputs->time_us = inputs->time_us;
    outputs->state = (uint8_t)robot->state;
    outputs->controller = robot->config->controller;
    outputs->setpoint_kind = tick.kind;
    outputs->faults = tick.faults;
    outputs->fault_history = robot->fault_history;
    outputs->config_sequence = robot->config->sequence;
}

uint32_t omni_robot_arming_faults(const omni_robot_t *robot, const omni_outputs_t *last) {
    const uint32_t faults = (uint32_t)(last->faults & (uint32_t)OMNI_FAULT_STOP_MASK);
    return robot->state == OMNI_STATE_DISARMED ? faults : faults | (uint32_t)OMNI_FAULT_CONFIG;
}
