/* SPDX-License-Identifier: MIT */
#include "robot_internal.h"

#include <string.h>

#include "omni/math.h"

/* Counts a wheel can move in a tick: thrice its no-load speed, and never less than four counts. */
static int32_t largest_step(const omni_robot_config_t *c, omni_real_t supply_V, uint32_t steps) {
    const omni_real_t no_load = supply_V / omni_motor_speed_gain(&c->motor);
    const omni_real_t counts = 3.0f * no_load * c->step_s * (omni_real_t)steps / c->rad_per_count;
    return counts < 1e6f ? (int32_t)counts + 4 : 1000000;
}

static void elapse(omni_robot_t *robot, omni_tick_t *tick) {
    const uint64_t now = tick->in->time_us;
    tick->steps = 0;
    if (robot->primed) {
        const uint64_t elapsed = now - robot->last_time_us;
        if (now <= robot->last_time_us || elapsed > (uint64_t)OMNI_TICK_JUMP_US) {
            tick->faults |= OMNI_FAULT_TIME;
            tick->steps = 1;
        } else {
            const uint32_t rounded = ((uint32_t)elapsed + OMNI_TICK_US / 2) / OMNI_TICK_US;
            tick->steps = rounded > 0 ? rounded : 1;
        }
    }
    robot->last_time_us = now;
}

/* Differences of the counters; a bit of the result per wheel whose difference can be trusted. */
static uint8_t read_counts(omni_robot_t *robot, omni_tick_t *tick) {
    const omni_robot_config_t *c = robot->config;
    const int32_t largest = largest_step(c, tick->out->supply_V, tick->steps);
    uint8_t valid = 0;
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        const uint32_t moved = (uint32_t)tick->in->counts[i] - (uint32_t)robot->last_counts[i];
        int32_t delta;
        memcpy(&delta, &moved, sizeof delta);
        const bool reported = (tick->in->counts_valid >> i & 1) != 0;
        const bool possible = robot->primed && delta <= largest && delta >= -largest;
        tick->delta_counts[i] = 0;
        if (reported && possible) {
            tick->delta_counts[i] = c->encoder_direction[i] < 0 ? -delta : delta;
            robot->encoder_ticks[i] = 0;
            valid |= (uint8_t)(1u << i);
        } else if (robot->primed) {
            tick->faults |= OMNI_WARN_ENCODER;
            ++robot->encoder_ticks[i];
            if (robot->encoder_ticks[i] >= OMNI_ENCODER_TICKS) {
                tick->faults |= OMNI_FAULT_ENCODER;
            }
        }
        if (reported || !robot->primed) {
            robot->last_counts[i] = tick->in->counts[i];
        }
    }
    return valid;
}

/* Wheel filters, then the angle each wheel turned: counted where the count can be trusted, else from the filter. */
static void estimate_wheels(omni_robot_t *robot, omni_tick_t *tick, uint8_t valid, omni_real_t *turned_rad) {
    const omni_robot_config_t *c = robot->config;
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        omni_motor_kf_state_t *kf = &robot->motor_kf[i];
        for (uint32_t missed = 1; missed < tick->steps; ++missed) {
            (void)omni_motor_kf_step(kf, &c->motor_kf, robot->last_voltage_V[i], 0, false);
        }
        const bool trusted = (valid >> i & 1) != 0;
        const omni_real_t speed =
            omni_motor_kf_step(kf, &c->motor_kf, robot->last_voltage_V[i], tick->delta_counts[i], trusted);
        tick->out->wheel_rad_s[i] = speed;
        tick->out->current_A[i] = c->motor_kf.mode == OMNI_KF_MODE_OFF ? 0.0f : kf->x[2];
        turned_rad[i] =
            trusted ? (omni_real_t)tick->delta_counts[i] * c->rad_per_count : speed * c->step_s * (omni_real_t)tick->steps;
    }
}

omni_real_t omni_robot_age_s(uint64_t now_us, uint64_t since_us) {
    const uint64_t age_us = now_us > since_us ? now_us - since_us : 0;
    return (omni_real_t)(uint32_t)(age_us < UINT32_MAX ? age_us : UINT32_MAX) * 1e-6f;
}

bool omni_robot_fix_is_fresh(const omni_robot_t *robot, uint64_t now_us) {
    const uint64_t last_us = robot->pose_ekf.last_fix_us;
    return last_us != 0 && omni_robot_age_s(now_us, last_us) <= robot->config->limits.fix_timeout_s;
}

static void use_fix(omni_robot_t *robot, omni_tick_t *tick) {
    const omni_robot_config_t *c = robot->config;
    omni_pose_ekf_state_t *ekf = &robot->pose_ekf;
    if (tick->in->has_fix && c->pose_ekf.mode != OMNI_EKF_MODE_ODOMETRY) {
        (void)omni_pose_ekf_correct(ekf, &c->pose_ekf, &c->kinematics, &tick->in->fix);
    }
    if (ekf->refused_in_row > 0) {
        tick->faults |= OMNI_WARN_FIX_REFUSED;
    }
    if (ekf->last_fix_us != 0 && !omni_robot_fix_is_fresh(robot, tick->in->time_us)) {
        tick->faults |= OMNI_WARN_POSE_STALE;
    }
}

static void report_estimate(const omni_robot_t *robot, omni_tick_t *tick) {
    const omni_robot_config_t *c = robot->config;
    const omni_pose_ekf_state_t *ekf = &robot->pose_ekf;
    omni_outputs_t *out = tick->out;
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        const omni_real_t ratio = c->pose_ekf.mode == OMNI_EKF_MODE_SLIP ? ekf->slip[i] : 0.0f;
        out->slip_m_s[i] = ratio * c->kinematics.radius_m[i] * out->wheel_rad_s[i]; /* v_s = s r phi' (eq. 18) */
    }
    omni_twist_t body;
    omni_kinematics_forward(&c->kinematics, out->wheel_rad_s, out->slip_m_s, &body);
    out->pose = ekf->pose;
    out->rate = omni_twist_to_world(&body, ekf->pose.theta);
    out->slip_residual_m_s = omni_kinematics_slip_residual(&c->kinematics, out->wheel_rad_s);
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        out->pose_sd[axis] = omni_sqrtf(ekf->p[axis][axis]);
    }
    out->nis = ekf->nis;
    out->fixes_accepted = ekf->accepted;
    out->fixes_refused = ekf->refused;
}

void omni_robot_estimate(omni_robot_t *robot, omni_tick_t *tick) {
    const omni_robot_config_t *c = robot->config;
    const omni_real_t battery = tick->in->battery_V;
    tick->out->supply_V = omni_is_finite(battery) && battery > 0.0f ? battery : c->limits.supply_nominal_V;
    if (!omni_is_finite(battery)) {
        tick->faults |= OMNI_FAULT_NOT_FINITE;
    }
    elapse(robot, tick);
    const uint8_t valid = read_counts(robot, tick);
    if (robot->primed) {
        omni_real_t turned_rad[OMNI_MAX_WHEELS] = {0};
        estimate_wheels(robot, tick, valid, turned_rad);
        omni_pose_ekf_predict(&robot->pose_ekf, &c->pose_ekf, &c->kinematics, turned_rad, tick->in->time_us);
        use_fix(robot, tick);
    }
    robot->primed = true;
    report_estimate(robot, tick);
}
