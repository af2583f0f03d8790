/* SPDX-License-Identifier: MIT */
#include "robot_internal.h"

#include "../math/math_inline.h"

/* A wheel under voltage must turn, and the way it is driven. What counts is the encoder itself, not the filter, which
 * believes its motor model too. A wheel that turns at a tenth of what the voltage gives is let through; one that stands still
 * uses up stall_s as time goes by, one that turns the other way at most twice as fast (a reversal of the voltage is legal). */
static void supervise_wheels(omni_robot_t *robot, omni_tick_t *tick) {
    const omni_robot_config_t *c = robot->config;
    const omni_real_t tenth_per_V = 0.1f / c->speed_gain_V_s;
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        const omni_real_t voltage = robot->last_voltage_V[i];
        const omni_flag_t pushed = omni_absf(voltage) >= c->limits.stall_V;
        if (!omni_any(pushed)) {
            robot->stalled_s[i] = 0.0f;
            continue;
        }
        const omni_real_t elapsed = c->step_s * (omni_real_t)tick->steps;
        const omni_real_t enough = omni_absf(voltage) * tenth_per_V * elapsed;
        const omni_real_t moved = (omni_real_t)tick->delta_counts[i] * c->rad_per_count * omni_signf(voltage);
        const omni_real_t missing = omni_clampf(1.0f - moved / enough, -2.0f, 2.0f);
        const omni_real_t stalled_s = omni_clampf(robot->stalled_s[i] + elapsed * missing, 0.0f, 2.0f * c->limits.stall_s);
        robot->stalled_s[i] = omni_select(pushed, stalled_s, 0.0f);
        if (robot->stalled_s[i] > c->limits.stall_s) {
            tick->faults |= OMNI_FAULT_STALL;
        }
    }
}

static void supervise_supply(omni_robot_t *robot, omni_tick_t *tick) {
    const omni_limits_t *limits = &robot->config->limits;
    robot->battery_ticks = tick->out->supply_V < limits->battery_min_V ? robot->battery_ticks + 1 : 0;
    if (robot->battery_ticks >= OMNI_BATTERY_TICKS) {
        tick->faults |= OMNI_FAULT_BATTERY;
    }
    if (tick->in->driver_failures >= limits->driver_failures) {
        tick->faults |= OMNI_FAULT_DRIVER;
    }
}

static void supervise_link(const omni_robot_t *robot, omni_tick_t *tick) {
    const omni_limits_t *limits = &robot->config->limits;
    if (tick->in->heartbeat_us == 0 || omni_robot_age_s(tick->in->time_us, tick->in->heartbeat_us) > limits->link_timeout_s) {
        tick->faults |= OMNI_FAULT_LINK_LOSS;
    }
}

static bool setpoint_is_finite(const omni_setpoint_t *setpoint) {
    return omni_pose_is_finite(&setpoint->pose) && omni_twist_is_finite(&setpoint->twist) &&
           omni_all_finite(setpoint->duty, OMNI_MAX_WHEELS);
}

static bool is_streamed(uint8_t kind) {
    return kind == OMNI_SETPOINT_POSE || kind == OMNI_SETPOINT_VELOCITY_BODY || kind == OMNI_SETPOINT_VELOCITY_WORLD ||
           kind == OMNI_SETPOINT_DUTY;
}

/* The set-point in force. A streamed one that has gone silent since arming is a fault; one from before is ignored. */
static void supervise_setpoint(const omni_robot_t *robot, omni_tick_t *tick) {
    const omni_setpoint_t *setpoint = &tick->in->setpoint;
    const omni_limits_t *limits = &robot->config->limits;
    tick->kind = setpoint->kind <= OMNI_SETPOINT_DUTY ? setpoint->kind : (uint8_t)OMNI_SETPOINT_NONE;
    if (!setpoint_is_finite(setpoint) || setpoint->kind > OMNI_SETPOINT_DUTY) {
        tick->faults |= OMNI_FAULT_NOT_FINITE;
        tick->kind = OMNI_SETPOINT_NONE;
    } else if (is_streamed(tick->kind) && omni_robot_age_s(tick->in->time_us, setpoint->time_us) > limits->command_timeout_s) {
        if (robot->state == OMNI_STATE_ARMED && setpoint->time_us >= robot->armed_since_us) {
            tick->faults |= OMNI_FAULT_COMMAND_LOSS;
        }
        tick->kind = OMNI_SETPOINT_NONE;
    } else if (tick->kind == OMNI_SETPOINT_POSE &&
               (omni_absf(setpoint->pose.x) > limits->position_m || omni_absf(setpoint->pose.y) > limits->position_m)) {
        tick->faults |= OMNI_WARN_SETPOINT;
        tick->kind = OMNI_SETPOINT_NONE;
    }
}

void omni_robot_supervise(omni_robot_t *robot, omni_tick_t *tick) {
    tick->faults |= tick->in->faults & (uint32_t)OMNI_FAULT_STOP_MASK;
    if (!omni_pose_is_finite(&tick->out->pose) || !omni_twist_is_finite(&tick->out->rate)) {
        tick->faults |= OMNI_FAULT_NOT_FINITE;
    }
    supervise_wheels(robot, tick);
    supervise_supply(robot, tick);
    supervise_link(robot, tick);
    supervise_setpoint(robot, tick);
    tick->faults |= omni_select(robot->saturated, (uint32_t)OMNI_WARN_SATURATED, 0u);
    if (robot->off_track) {
        tick->faults |= OMNI_FAULT_TRACKING;
    }
}

static void reset_controllers(omni_robot_t *robot) {
    omni_ismc_reset(&robot->ismc);
    omni_fl_reset(&robot->fl);
    omni_original_reset(&robot->original);
    omni_wheel_speed_reset(&robot->wheel_speed);
    robot->control_ticks = 0;
    robot->ramped = (omni_twist_t){0.0f, 0.0f, 0.0f};
}

static void enter_armed(omni_robot_t *robot, const omni_tick_t *tick) {
    reset_controllers(robot);
    robot->governed = tick->out->pose;
    robot->armed_since_us = tick->in->time_us;
    robot->trajectory_start_us = tick->in->time_us;
    robot->fault_history = 0;
}

static void apply(omni_robot_t *robot, omni_safety_event_t event) {
    robot->state = omni_safety_next(robot->state, event);
}

/* Events that move the estimate or the trajectory. */
static void apply_requests(omni_robot_t *robot, omni_tick_t *tick) {
    const uint32_t events = tick->in->events;
    if ((events & OMNI_EVENT_SET_POSE) != 0 && robot->state != OMNI_STATE_ARMED && omni_pose_is_finite(&tick->in->pose)) {
        const omni_pose_ekf_config_t *ekf = &robot->config->pose_ekf;
        omni_pose_ekf_reset(&robot->pose_ekf, ekf, &tick->in->pose, omni_sqrtf(ekf->r_xy), omni_sqrtf(ekf->r_theta));
        robot->pose_ekf.time_us = tick->in->time_us;
        tick->out->pose = robot->pose_ekf.pose;
        tick->heading = omni_rotation(tick->out->pose.theta);
    }
    if ((events & OMNI_EVENT_TRAJECTORY_START) != 0 && tick->in->trajectory != NULL) {
        robot->trajectory = tick->in->trajectory;
        robot->trajectory_start_us = tick->in->time_us;
    }
    if ((events & OMNI_EVENT_TRAJECTORY_STOP) != 0) {
        robot->trajectory = NULL;
        robot->governed = tick->out->pose;
    }
}

void omni_robot_transition(omni_robot_t *robot, omni_tick_t *tick) {
    const uint32_t events = tick->in->events;
    const omni_safety_state_t before = robot->state;
    apply_requests(robot, tick);
    if (robot->state == OMNI_STATE_INIT) {
        apply(robot, OMNI_SAFETY_READY);
    }
    if ((events & OMNI_EVENT_ESTOP_CLEAR) != 0) {
        apply(robot, OMNI_SAFETY_ESTOP_CLEAR);
    }
    if ((events & OMNI_EVENT_ARM) != 0 && (tick->faults & (uint32_t)OMNI_FAULT_STOP_MASK) == 0) {
        apply(robot, OMNI_SAFETY_ARM);
    }
    if (robot->state == OMNI_STATE_ARMED && before != OMNI_STATE_ARMED) {
        enter_armed(robot, tick);
    }
    if ((events & OMNI_EVENT_DISARM) != 0) {
        apply(robot, OMNI_SAFETY_DISARM);
    }
    if ((tick->faults & (uint32_t)OMNI_FAULT_STOP_MASK) != 0) {
        if (robot->state == OMNI_STATE_ARMED) {
            robot->fault_history |= (uint32_t)(tick->faults & (uint32_t)OMNI_FAULT_STOP_MASK);
        }
        apply(robot, OMNI_SAFETY_FAULT);
    }
    if ((events & OMNI_EVENT_ESTOP) != 0) {
        apply(robot, OMNI_SAFETY_ESTOP);
    }
}
