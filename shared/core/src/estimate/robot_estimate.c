/* SPDX-License-Identifier: MIT */
#include "../tick/stages.h"

#include <string.h>

#include "../math/invariant.h"
#include "../model/kinematics_inline.h"
#include "pose_ekf_inline.h"

/* Counts a wheel can move in a tick: thrice its no-load speed, and never less than four counts. */
static omni_int_t largest_step(const omni_robot_config_t *c, omni_real_t supply_V, uint32_t steps) {
    const omni_real_t no_load = supply_V / c->speed_gain_V_s;
    const omni_real_t counts = 3.0f * no_load * c->step_s * (omni_real_t)steps / c->rad_per_count;
    return omni_select(counts < 1e6f, (omni_int_t)counts + 4, 1000000);
}

/* Tick periods since the last tick, 0 on the first, 1 if the time is invalid. */
static omni_uint_t count_steps(omni_estimator_t *estimator, uint64_t now, uint32_t *steps) {
    omni_uint_t faults = 0;
    *steps = 0;
    if (estimator->primed) {
        const uint64_t elapsed = now - estimator->last_time_us;
        *steps = 1;
        if (now <= estimator->last_time_us || elapsed > (uint64_t)OMNI_TICK_JUMP_US) {
            faults = OMNI_FAULT_TIME;
        } else {
            const uint32_t rounded = ((uint32_t)elapsed + OMNI_TICK_US / 2) / OMNI_TICK_US;
            *steps = rounded > 0 ? rounded : 1;
        }
    }
    estimator->last_time_us = now;
    return faults;
}

/* Validity of the counts, a bit per wheel. */
typedef struct count_validity_t {
    uint8_t trusted; /* the difference can be used */
    uint8_t jumped;  /* the counter has jumped by an unknown amount */
} count_validity_t;

/* Differences of the counters. */
static omni_uint_t read_counts(omni_estimator_t *estimator, const omni_robot_config_t *c, const omni_inputs_t *inputs,
                               omni_estimate_t *estimate, count_validity_t *counted) {
    const omni_int_t largest = largest_step(c, estimate->supply_V, estimate->steps);
    omni_uint_t faults = 0;
    counted->trusted = 0;
    counted->jumped = 0;
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        const omni_uint_t moved = (omni_uint_t)inputs->counts[i] - (omni_uint_t)estimator->last_counts[i];
        omni_int_t delta;
        memcpy(&delta, &moved, sizeof delta);
        const bool reported = (inputs->counts_valid >> i & 1) != 0;
        const bool possible = estimator->primed && delta <= largest && delta >= -largest;
        estimate->delta_counts[i] = 0;
        if (reported && possible) {
            estimate->delta_counts[i] = c->encoder_direction[i] < 0 ? -delta : delta;
            estimator->missing_count_ticks[i] = 0;
            counted->trusted |= (uint8_t)(1u << i);
        } else if (estimator->primed) {
            counted->jumped |= (uint8_t)((reported ? 1u : 0u) << i);
            faults |= OMNI_WARN_ENCODER;
            ++estimator->missing_count_ticks[i];
            if (estimator->missing_count_ticks[i] >= OMNI_ENCODER_TICKS) {
                faults |= OMNI_FAULT_ENCODER;
            }
        }
        if (reported || !estimator->primed) {
            estimator->last_counts[i] = inputs->counts[i];
        }
    }
    return faults;
}

/* Rotation of a wheel: from a valid count, else extrapolated from the filter's speed. The first valid count after a gap
 * contains the whole motion, so what was extrapolated is subtracted. */
static omni_real_t turned_angle(omni_estimator_t *estimator, const omni_robot_config_t *c,
                                const omni_estimate_t *estimate, uint8_t wheel, const count_validity_t *counted) {
    omni_real_t *guessed = &estimator->extrapolated_rad[wheel];
    if ((counted->trusted >> wheel & 1) != 0) {
        const omni_real_t counted_rad = (omni_real_t)estimate->delta_counts[wheel] * c->rad_per_count - *guessed;
        *guessed = 0.0f;
        return counted_rad;
    }
    const omni_real_t guess = estimate->wheel_rad_s[wheel] * c->step_s * (omni_real_t)estimate->steps;
    *guessed = (counted->jumped >> wheel & 1) != 0 ? 0.0f : *guessed + guess;
    return guess;
}

/* Wheel filters, then the angles. */
static void estimate_wheels(omni_estimator_t *estimator, const omni_robot_config_t *c, const count_validity_t *counted,
                            const omni_real_t *applied_V, omni_estimate_t *estimate, omni_real_t *turned_rad) {
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        omni_motor_kf_state_t *kf = &estimator->motor_kf[i];
        for (uint32_t missed = 1; missed < estimate->steps; ++missed) {
            (void)omni_motor_kf_step(kf, &c->motor_kf, applied_V[i], 0, false);
        }
        const bool trusted = (counted->trusted >> i & 1) != 0;
        estimate->wheel_rad_s[i] =
            omni_motor_kf_step(kf, &c->motor_kf, applied_V[i], estimate->delta_counts[i], trusted);
        if ((counted->jumped >> i & 1) != 0) {
            omni_motor_kf_rebase(kf);
        }
        turned_rad[i] = turned_angle(estimator, c, estimate, i, counted);
    }
}

omni_real_t omni_robot_age_s(uint64_t now_us, uint64_t since_us) {
    const uint64_t age_us = now_us > since_us ? now_us - since_us : 0;
    return (omni_real_t)(uint32_t)(age_us < UINT32_MAX ? age_us : UINT32_MAX) * 1e-6f;
}

static bool fix_is_fresh(const omni_pose_ekf_state_t *ekf, const omni_robot_config_t *c, uint64_t now_us) {
    return ekf->last_fix_us != 0 && omni_robot_age_s(now_us, ekf->last_fix_us) <= c->limits.fix_timeout_s;
}

/* Prediction with a gyro. */
static omni_uint_t predict_with_gyro(omni_estimator_t *estimator, const omni_robot_config_t *c,
                                     const omni_inputs_t *inputs, const omni_estimate_t *estimate, uint8_t trusted,
                                     bool interval_valid, const omni_real_t *turned_rad, const omni_real_t *applied_V)
    __attribute__((noinline));

static omni_uint_t predict_with_gyro(omni_estimator_t *estimator, const omni_robot_config_t *c,
                                     const omni_inputs_t *inputs, const omni_estimate_t *estimate, uint8_t trusted,
                                     bool interval_valid, const omni_real_t *turned_rad, const omni_real_t *applied_V) {
    omni_gyro_tick_t tick = {.time_us = inputs->time_us,
                             .reading = inputs->gyro_rad_s,
                             .valid = inputs->gyro_valid,
                             .interval_valid = interval_valid,
                             .duration_s = c->step_s * (omni_real_t)estimate->steps};
    omni_twist_t body;
    omni_kinematics_forward(&c->kinematics, estimate->wheel_rad_s, NULL, &body);
    tick.wheel_yaw_rate_rad_s = body.wz;
    tick.wheels_x_m_s = body.vx;
    tick.wheels_y_m_s = body.vy;
    tick.motors_driven = false;
    tick.wheels_still = trusted == (1u << c->kinematics.wheels) - 1u;
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        tick.wheels_still = tick.wheels_still && estimate->delta_counts[i] == 0;
        tick.motors_driven = tick.motors_driven || applied_V[i] != 0.0f;
    }
    const bool usable =
        omni_gyro_step(&estimator->gyro, &c->gyro, &tick, &estimator->pose_ekf, &c->pose_ekf, &c->kinematics);
    omni_pose_ekf_predict_gyro(&estimator->pose_ekf, &c->pose_ekf, &c->kinematics, turned_rad, &estimator->gyro.turn,
                               inputs->time_us);
    return usable ? (omni_uint_t)0u : (omni_uint_t)OMNI_WARN_GYRO;
}

/* Correction by floor odometry. */
static omni_uint_t use_flow(omni_estimator_t *estimator, const omni_robot_config_t *c, const omni_inputs_t *inputs,
                            bool interval_valid) __attribute__((noinline));

static omni_uint_t use_flow(omni_estimator_t *estimator, const omni_robot_config_t *c, const omni_inputs_t *inputs,
                            bool interval_valid) {
    const omni_flow_tick_t tick = {.time_us = inputs->time_us,
                                   .reading = inputs->flow_moved,
                                   .valid = inputs->flow_valid,
                                   .interval_valid = interval_valid};
    const bool usable =
        omni_flow_step(&estimator->flow, &c->flow, &tick, &estimator->pose_ekf, &c->pose_ekf, &c->kinematics);
    return usable ? (omni_uint_t)0u : (omni_uint_t)OMNI_WARN_FLOW;
}

/* Pose fixes are of the tracked body (FIX_X, FIX_Y, FIX_TH). The fix's own heading leads to the wheels' centre: 5 mrad
 * of noise and 0.1 m are 0.5 mm, a tenth of the position's noise. */
static omni_pose_fix_t centre_fix(const omni_robot_config_t *c, const omni_pose_fix_t *fix) {
    omni_pose_fix_t centre = *fix;
    centre.pose.theta -= c->tracked_heading_rad;
    const omni_rotation_t heading = omni_rotation(centre.pose.theta);
    const omni_twist_t arm = {c->tracked_x_m, c->tracked_y_m, 0.0f};
    const omni_twist_t world = omni_rotate_to_world(&arm, &heading);
    centre.pose.x -= world.vx;
    centre.pose.y -= world.vy;
    return centre;
}

static omni_uint_t use_fix(omni_pose_ekf_state_t *ekf, const omni_robot_config_t *c, const omni_inputs_t *inputs,
                           bool *is_fresh) {
    omni_uint_t faults = 0;
    if (inputs->has_fix && c->pose_ekf.mode != OMNI_EKF_MODE_ODOMETRY) {
        const omni_pose_fix_t fix = centre_fix(c, &inputs->fix);
        (void)omni_pose_ekf_correct(ekf, &c->pose_ekf, &c->kinematics, &fix);
    }
    if (ekf->consecutive_refusals > 0) {
        faults |= OMNI_WARN_FIX_REFUSED;
    }
    *is_fresh = fix_is_fresh(ekf, c, inputs->time_us);
    if (ekf->last_fix_us != 0 && !*is_fresh) {
        faults |= OMNI_WARN_POSE_STALE;
    }
    return faults;
}

static void read_pose(const omni_pose_ekf_state_t *ekf, omni_estimate_t *estimate) {
    estimate->pose = ekf->pose;
    estimate->heading = omni_rotation(ekf->pose.theta);
}

static omni_real_t slip_ratio(const omni_pose_ekf_state_t *ekf, const omni_robot_config_t *c, uint8_t wheel) {
    return c->pose_ekf.mode == OMNI_EKF_MODE_SLIP ? ekf->error_state[wheel] : 0.0f;
}

/* Slip, twist, and the filter's diagnostics. */
static void derive_motion(const omni_pose_ekf_state_t *ekf, const omni_robot_config_t *c, omni_estimate_t *estimate) {
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        const omni_real_t ratio = slip_ratio(ekf, c, i);
        estimate->slip_ratio[i] = ratio;
        estimate->slip_m_s[i] =
            ratio * c->kinematics.radius_m[i] * estimate->wheel_rad_s[i]; /* v_s = s r phi' (eq. 18) */
    }
    omni_twist_t body;
    omni_kinematics_forward(&c->kinematics, estimate->wheel_rad_s, estimate->slip_m_s, &body);
    estimate->rate = omni_rotate_to_world(&body, &estimate->heading);
    estimate->nis = ekf->nis;
    estimate->fixes_accepted = ekf->accepted;
    estimate->fixes_refused = ekf->refused;
}

omni_uint_t omni_robot_estimate(omni_estimator_t *estimator, const omni_robot_config_t *config,
                                const omni_inputs_t *inputs, const omni_applied_t *last, omni_estimate_t *estimate) {
    const omni_real_t most_V = 1000.0f; /* beyond it the reading is invalid: the filters' squares would overflow */
    const bool measured = inputs->battery_V >= -most_V && inputs->battery_V <= most_V;
    count_validity_t counted;
    memset(estimate->wheel_rad_s, 0, sizeof estimate->wheel_rad_s);
    memset(estimate->slip_m_s, 0, sizeof estimate->slip_m_s);
    estimate->supply_V = measured && inputs->battery_V > 0.0f ? inputs->battery_V : config->limits.supply_nominal_V;
    omni_uint_t faults = measured ? (omni_uint_t)0u : (omni_uint_t)OMNI_FAULT_NOT_FINITE;
    faults |= count_steps(estimator, inputs->time_us, &estimate->steps);
    OMNI_INVARIANT(omni_all(estimate->supply_V > 0.0f) && estimate->steps <= OMNI_TICK_JUMP_US / OMNI_TICK_US);
    faults |= read_counts(estimator, config, inputs, estimate, &counted);
    estimate->fix_is_fresh = false;
    if (estimator->primed) {
        omni_real_t turned_rad[OMNI_MAX_WHEELS] = {0};
        estimate_wheels(estimator, config, &counted, last->voltage_V, estimate, turned_rad);
        if (config->gyro.axis == 0) {
            omni_pose_ekf_predict(&estimator->pose_ekf, &config->pose_ekf, &config->kinematics, turned_rad,
                                  inputs->time_us);
        } else {
            const bool interval_valid = (faults & (uint32_t)OMNI_FAULT_TIME) == 0;
            faults |= predict_with_gyro(estimator, config, inputs, estimate, counted.trusted, interval_valid,
                                        turned_rad, last->voltage_V);
        }
        if (config->flow.axes != 0) {
            faults |= use_flow(estimator, config, inputs, (faults & (uint32_t)OMNI_FAULT_TIME) == 0);
        }
        faults |= use_fix(&estimator->pose_ekf, config, inputs, &estimate->fix_is_fresh);
    }
    estimator->primed = true;
    read_pose(&estimator->pose_ekf, estimate);
    derive_motion(&estimator->pose_ekf, config, estimate);
    return faults;
}

void omni_robot_set_pose(omni_estimator_t *estimator, const omni_robot_config_t *config, const omni_inputs_t *inputs,
                         omni_estimate_t *estimate) {
    omni_ekf_gyro_calibration_t gyro;
    omni_pose_ekf_get_gyro(&estimator->pose_ekf, &gyro);
    omni_pose_ekf_set_pose(&estimator->pose_ekf, &config->pose_ekf, &inputs->pose, inputs->time_us);
    omni_pose_ekf_set_gyro(&estimator->pose_ekf, &gyro);
    memset(estimator->flow.accumulated_correction, 0,
           sizeof estimator->flow.accumulated_correction); /* those corrections were of the previous pose */
    read_pose(&estimator->pose_ekf, estimate);
    for (uint8_t i = 0; i < config->kinematics.wheels; ++i) {
        estimate->slip_ratio[i] = slip_ratio(&estimator->pose_ekf, config, i);
    }
}

void omni_robot_restart_filters(omni_estimator_t *estimator, const omni_robot_config_t *config,
                                const omni_estimate_t *estimate) {
    const bool finite = omni_all_finite(estimate->wheel_rad_s, OMNI_MAX_WHEELS);
    for (uint8_t i = 0; !finite && i < config->kinematics.wheels; ++i) {
        if (!omni_is_finite(estimate->wheel_rad_s[i])) {
            omni_motor_kf_reset(&estimator->motor_kf[i], &config->motor_kf);
        }
    }
    if (!omni_pose_is_finite(&estimate->pose)) {
        const omni_pose_t origin = {0.0f, 0.0f, 0.0f};
        omni_pose_ekf_reset(&estimator->pose_ekf, &config->pose_ekf, &origin, config->limits.position_m, OMNI_PI_F);
        memset(&estimator->gyro, 0, sizeof estimator->gyro);
        memset(&estimator->flow, 0, sizeof estimator->flow);
    }
}
