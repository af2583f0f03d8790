/* SPDX-License-Identifier: MIT */
#include "robot_internal.h"

#include <string.h>

#include "../kinematics/kinematics_inline.h"

/* Counts a wheel can move in a tick: thrice its no-load speed, and never less than four counts. */
static omni_int_t largest_step(const omni_robot_config_t *c, omni_real_t supply_V, uint32_t steps) {
    const omni_real_t no_load = supply_V / c->speed_gain_V_s;
    const omni_real_t counts = 3.0f * no_load * c->step_s * (omni_real_t)steps / c->rad_per_count;
    return omni_select(counts < 1e6f, (omni_int_t)counts + 4, 1000000);
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

/* Bits per wheel. */
typedef struct counted_t {
    uint8_t trusted; /* the difference can be used */
    uint8_t jumped;  /* the counter is somewhere else now, and nobody knows how far that is */
} counted_t;

/* Differences of the counters. */
static counted_t read_counts(omni_robot_t *robot, omni_tick_t *tick) {
    const omni_robot_config_t *c = robot->config;
    const omni_int_t largest = largest_step(c, tick->out->supply_V, tick->steps);
    counted_t counted = {0, 0};
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        const omni_uint_t moved = (omni_uint_t)tick->in->counts[i] - (omni_uint_t)robot->last_counts[i];
        omni_int_t delta;
        memcpy(&delta, &moved, sizeof delta);
        const bool reported = (tick->in->counts_valid >> i & 1) != 0;
        const bool possible = robot->primed && delta <= largest && delta >= -largest;
        tick->delta_counts[i] = 0;
        if (reported && possible) {
            tick->delta_counts[i] = c->encoder_direction[i] < 0 ? -delta : delta;
            robot->encoder_ticks[i] = 0;
            counted.trusted |= (uint8_t)(1u << i);
        } else if (robot->primed) {
            counted.jumped |= (uint8_t)((reported ? 1u : 0u) << i);
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
    return counted;
}

/* The angle a wheel turned: counted where the count can be trusted, else guessed from the filter's speed. Counts that stayed away for a
 * while come with all they moved since; the guesses for that while are taken back. */
static omni_real_t turned(omni_robot_t *robot, const omni_tick_t *tick, uint8_t wheel, const counted_t *counted) {
    const omni_robot_config_t *c = robot->config;
    omni_real_t *guessed = &robot->guessed_rad[wheel];
    if ((counted->trusted >> wheel & 1) != 0) {
        const omni_real_t counted_rad = (omni_real_t)tick->delta_counts[wheel] * c->rad_per_count - *guessed;
        *guessed = 0.0f;
        return counted_rad;
    }
    const omni_real_t guess = tick->out->wheel_rad_s[wheel] * c->step_s * (omni_real_t)tick->steps;
    *guessed = (counted->jumped >> wheel & 1) != 0 ? 0.0f : *guessed + guess;
    return guess;
}

/* Wheel filters, then the angles. */
static void estimate_wheels(omni_robot_t *robot, omni_tick_t *tick, const counted_t *counted, omni_real_t *turned_rad) {
    const omni_robot_config_t *c = robot->config;
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        omni_motor_kf_state_t *kf = &robot->motor_kf[i];
        for (uint32_t missed = 1; missed < tick->steps; ++missed) {
            (void)omni_motor_kf_step(kf, &c->motor_kf, robot->last_voltage_V[i], 0, false);
        }
        const bool trusted = (counted->trusted >> i & 1) != 0;
        tick->out->wheel_rad_s[i] =
            omni_motor_kf_step(kf, &c->motor_kf, robot->last_voltage_V[i], tick->delta_counts[i], trusted);
        if ((counted->jumped >> i & 1) != 0) {
            omni_motor_kf_rebase(kf);
        }
        tick->out->current_A[i] = c->motor_kf.mode == OMNI_KF_MODE_OFF ? 0.0f : kf->x[2];
        turned_rad[i] = turned(robot, tick, i, counted);
    }
}

omni_real_t omni_robot_age_s(uint64_t now_us, uint64_t since_us) {
    const uint64_t age_us = now_us > since_us ? now_us - since_us : 0;
    return (omni_real_t)(uint32_t)(age_us < UINT32_MAX ? age_us : UINT32_MAX) * 1e-6f;
}

static bool fix_is_fresh(const omni_robot_t *robot, uint64_t now_us) {
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
    tick->fix_is_fresh = fix_is_fresh(robot, tick->in->time_us);
    if (ekf->last_fix_us != 0 && !tick->fix_is_fresh) {
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
    tick->heading = omni_rotation(ekf->pose.theta);
    out->rate = omni_rotate_to_world(&body, &tick->heading);
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
    const counted_t counted = read_counts(robot, tick);
    tick->fix_is_fresh = false;
    if (robot->primed) {
        omni_real_t turned_rad[OMNI_MAX_WHEELS] = {0};
        estimate_wheels(robot, tick, &counted, turned_rad);
        omni_pose_ekf_predict(&robot->pose_ekf, &c->pose_ekf, &c->kinematics, turned_rad, tick->in->time_us);
        use_fix(robot, tick);
    }
    robot->primed = true;
    report_estimate(robot, tick);
}
