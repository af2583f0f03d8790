/* SPDX-License-Identifier: MIT */
/**
 * @file pose_ekf_motion.h
 * Prediction of the pose EKF, with and without a gyro. Two sources include it, one for each, so that robots without a
 * gyro do not pay its run time. Not part of the API.
 */
#ifndef OMNI_POSE_EKF_MOTION_H
#define OMNI_POSE_EKF_MOTION_H

#include "../model/kinematics_inline.h"
#include "pose_ekf_internal.h"

/* 2 pi = whole_turn + whole_turn_rest. */
static const omni_real_t whole_turn = 6.28318530717958647692f;
static const omni_real_t whole_turn_rest = -1.74845553e-7f;

/* Kahan summation: sum + compensation += increment. */
static inline void add_compensated(omni_real_t *sum, omni_real_t *compensation, omni_real_t increment) {
    const omni_real_t whole = increment + *compensation;
    const omni_real_t next = *sum + whole;
    *compensation = whole - (next - *sum);
    *sum = next;
}

static inline void move_pose(omni_pose_ekf_state_t *state, const omni_real_t *delta) {
    omni_pose_t *pose = &state->pose;
    add_compensated(&pose->x, &state->kahan_compensation[0], delta[0]);
    add_compensated(&pose->y, &state->kahan_compensation[1], delta[1]);
    add_compensated(&pose->theta, &state->kahan_compensation[2], delta[2]);
    const omni_flag_t outside = pose->theta >= OMNI_PI_F || pose->theta < -OMNI_PI_F;
    if (omni_any(outside)) {
        const omni_real_t turns = omni_select(outside, omni_signf(pose->theta), 0.0f);
        pose->theta -= turns * whole_turn;
        state->kahan_compensation[2] -= turns * whole_turn_rest;
    }
    if (omni_absf(pose->theta) > OMNI_PI_F) {
        pose->theta = omni_wrap_pi(pose->theta);
    }
}

/* The gyro's turn in one tick. */
typedef struct gyro_turn_t {
    bool overrides_wheels;
    omni_real_t turned_rad; /* bias and scale error corrected */
    omni_real_t unscaled;   /* bias corrected only */
    omni_real_t duration_s;
} gyro_turn_t;

static inline void set_elapsed_time(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                    uint64_t time_us, omni_ekf_motion_t *motion) {
    const uint64_t longest_us = 1000000000;
    const omni_real_t nominal_us = config->step_s * 1e6f;
    if (state->time_us == 0) {
        state->last_absolute_update_us = time_us;
        motion->duration_us = (uint32_t)(nominal_us + 0.5f);
    } else {
        const uint64_t elapsed = time_us > state->time_us ? time_us - state->time_us : 0;
        motion->duration_us = (uint32_t)(elapsed < longest_us ? elapsed : longest_us);
    }
    motion->steps = (omni_real_t)motion->duration_us / nominal_us;
    motion->slip_steps = motion->steps * state->slip_noise_factor;
    motion->noise_steps = motion->steps * state->pose_noise_factor;
    state->time_us = time_us;
}

/* eq. 22 with slip, over a tick. */
static inline void move_body(const omni_pose_ekf_state_t *state, const omni_kinematics_t *k,
                             const omni_real_t *wheel_delta_rad, uint8_t slip_states, const gyro_turn_t *gyro,
                             omni_ekf_motion_t *motion) {
    omni_real_t slip_m[OMNI_MAX_WHEELS];
    omni_twist_t body;
#ifdef __clang_analyzer__ /* it does not know that there is no slip, or one per wheel */
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        slip_m[i] = 0.0f;
    }
#endif
    for (uint8_t i = 0; i < slip_states; ++i) {
        slip_m[i] = state->error_state[i] * k->radius_m[i] * wheel_delta_rad[i];
    }
    omni_kinematics_forward(k, wheel_delta_rad, slip_states > 0 ? slip_m : NULL, &body);
    if (gyro != NULL) {
        body.wz = gyro->overrides_wheels ? gyro->turned_rad : body.wz;
    }
    omni_real_t sine;
    omni_real_t cosine;
    omni_sincosf(state->pose.theta + (state->kahan_compensation[2] + 0.5f * body.wz), &sine, &cosine);
    motion->move[0] = cosine * body.vx - sine * body.vy;
    motion->move[1] = sine * body.vx + cosine * body.vy;
    motion->move[2] = body.wz;
}

/* Add the tick's slip noise and wheel motion to the open slot. With a gyro, the Jacobian of the turn depends in each
 * tick on whether the gyro overrides the wheels, so it is summed here; complete_slot_jacobian() does the rest. */
static inline void accumulate_slot(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                   const omni_kinematics_t *k, const omni_real_t *wheel_delta_rad, uint8_t slip_states,
                                   const gyro_turn_t *gyro, const omni_ekf_motion_t *motion) {
    omni_ekf_slot_t *slot = &state->history[state->open_slot];
    for (uint8_t i = 0; i < slip_states; ++i) {
        const omni_real_t rolled = k->radius_m[i] * wheel_delta_rad[i];
        const omni_flag_t known = state->p[OMNI_AXES + i][OMNI_AXES + i] < config->p_slip;
        slot->slip_noise[i] += omni_select(rolled != 0.0f && known, config->q_slip * motion->slip_steps, 0.0f);
        state->slot_wheel_m[i] += rolled;
        if (gyro != NULL) {
            slot->jacobian[2][i] -= gyro->overrides_wheels ? 0.0f : k->b_pinv[2][i] * rolled;
        }
    }
    if (gyro != NULL) {
        const omni_real_t scale = 1.0f + state->error_state[OMNI_EKF_GYRO_SCALE];
        slot->jacobian[2][OMNI_EKF_GYRO_BIAS] -= gyro->overrides_wheels ? gyro->duration_s * scale : 0.0f;
        slot->jacobian[2][OMNI_EKF_GYRO_SCALE] += gyro->overrides_wheels ? gyro->unscaled : 0.0f;
    }
}

/*
 * Jacobian of the open slot's motion by the error states. A wheel moves the body along its column of B+ at the heading
 * of mid-slot, and an error of the turn rotates half of the motion. Changes of speed within a slot alter that by less
 * than the encoder quantisation.
 */
static inline void complete_slot_jacobian(omni_pose_ekf_state_t *state, const omni_kinematics_t *k, uint8_t slip_states,
                                          bool has_gyro) {
    omni_ekf_slot_t *slot = &state->history[state->open_slot];
    const omni_real_t half_turn = omni_clampf(0.5f * slot->move[2], -0.5f, 0.5f);
    const omni_real_t cosine = 1.0f - 0.5f * half_turn * half_turn;
    const omni_real_t sine = half_turn - half_turn * half_turn * half_turn * (1.0f / 6.0f);
    const omni_real_t arm[2] = {0.5f * slot->move[0], 0.5f * slot->move[1]};
    for (uint8_t i = 0; i < slip_states; ++i) {
        const omni_real_t along = k->b_pinv[0][i] * state->slot_wheel_m[i];
        const omni_real_t across = k->b_pinv[1][i] * state->slot_wheel_m[i];
        if (!has_gyro) {
            slot->jacobian[2][i] = -k->b_pinv[2][i] * state->slot_wheel_m[i];
        }
        slot->jacobian[0][i] = sine * across - cosine * along - arm[1] * slot->jacobian[2][i];
        slot->jacobian[1][i] = arm[0] * slot->jacobian[2][i] - sine * along - cosine * across;
    }
    for (int i = OMNI_EKF_GYRO_BIAS; has_gyro && i <= OMNI_EKF_GYRO_SCALE; ++i) {
        slot->jacobian[0][i] = -arm[1] * slot->jacobian[2][i];
        slot->jacobian[1][i] = arm[0] * slot->jacobian[2][i];
    }
}

/* value = F value for a column (x, y, theta), F = 1, -dy; 1, dx; 1. */
static inline void transport_covariance(omni_real_t *x, omni_real_t *y, omni_real_t theta, const omni_real_t *moved) {
    *x -= moved[1] * theta;
    *y += moved[0] * theta;
}

/* P_pp = F P_pp F^T (eq. 62); only the upper triangle is computed. */
static inline void propagate_pose_covariance(omni_pose_ekf_state_t *state, const omni_real_t *moved) {
    omni_real_t(*p)[OMNI_EKF_STATES] = state->p;
    const omni_real_t dx = moved[0];
    const omni_real_t dy = moved[1];
    const omni_real_t xt = p[0][2] - dy * p[2][2];
    const omni_real_t yt = p[1][2] + dx * p[2][2];
    p[0][0] -= dy * (p[0][2] + xt);
    p[0][1] += dx * xt - dy * p[1][2];
    p[1][1] += dx * (p[1][2] + yt);
    p[0][2] = xt;
    p[1][2] = yt;
}

/* With A = F P_ps and P_ps' = A + G P_ss:  P_pp += A G^T + G P_ps'^T,  P_ps = P_ps'. */
static inline void propagate_slip_covariance(omni_pose_ekf_state_t *state, const omni_real_t *moved,
                                             omni_real_t gain[OMNI_AXES][OMNI_EKF_ERROR_STATES], uint8_t error_states) {
    omni_real_t(*p)[OMNI_EKF_STATES] = state->p;
    omni_real_t before[OMNI_AXES][OMNI_EKF_ERROR_STATES];
    for (uint8_t i = 0; i < error_states; ++i) {
        const uint8_t column = (uint8_t)(OMNI_AXES + i);
        transport_covariance(&p[0][column], &p[1][column], p[2][column], moved);
        for (int a = 0; a < OMNI_AXES; ++a) {
            before[a][i] = p[a][column];
            for (uint8_t j = 0; j < error_states; ++j) {
                p[a][column] += gain[a][j] * p[OMNI_AXES + j][column];
            }
            p[column][a] = p[a][column];
        }
    }
    for (int a = 0; a < OMNI_AXES; ++a) {
        for (int b = a; b < OMNI_AXES; ++b) {
            for (uint8_t i = 0; i < error_states; ++i) {
                p[a][b] += before[a][i] * gain[b][i] + gain[a][i] * p[b][OMNI_AXES + i];
            }
        }
    }
}

/* A slot's gyro noise can be below the resolution of theta's variance. Accumulate it until it is not. */
static inline omni_real_t take_due_gyro_noise(omni_pose_ekf_state_t *state, omni_real_t more) {
    const omni_real_t waiting = state->pending_turn_noise + more;
    const omni_flag_t due = waiting >= state->p[2][2] * 1e-5f;
    state->pending_turn_noise = omni_select(due, 0.0f, waiting);
    return omni_select(due, waiting, 0.0f);
}

/* Motion of the open slot that `p` does not contain: all of it, or the part since the last propagation. Consecutive
 * motions compose: jacobian = F_rest jacobian_propagated + jacobian_rest. */
static inline void find_unpropagated_motion(const omni_pose_ekf_state_t *state, uint8_t error_states,
                                            omni_ekf_slot_t *rest) {
    const omni_ekf_slot_t *slot = &state->history[state->open_slot];
    const omni_ekf_slot_t *in_p = &state->last_propagated_slot;
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        rest->move[axis] = slot->move[axis];
        for (uint8_t i = 0; i < error_states; ++i) {
            rest->jacobian[axis][i] = slot->jacobian[axis][i];
        }
    }
    for (uint8_t i = 0; i < error_states && i < OMNI_MAX_WHEELS; ++i) {
        rest->slip_noise[i] = slot->slip_noise[i];
    }
    rest->steps = slot->steps;
    rest->turn_noise = slot->turn_noise;
    rest->duration_us = slot->duration_us;
    if (state->unpropagated_ticks == state->slot_ticks) {
        return;
    }
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        rest->move[axis] -= in_p->move[axis];
    }
    for (uint8_t i = 0; i < error_states; ++i) {
        for (int axis = 0; axis < OMNI_AXES; ++axis) {
            rest->jacobian[axis][i] -= in_p->jacobian[axis][i];
        }
        rest->jacobian[0][i] += rest->move[1] * in_p->jacobian[2][i];
        rest->jacobian[1][i] -= rest->move[0] * in_p->jacobian[2][i];
    }
    for (uint8_t i = 0; i < error_states && i < OMNI_MAX_WHEELS; ++i) {
        rest->slip_noise[i] -= in_p->slip_noise[i];
    }
    rest->steps -= in_p->steps;
    rest->turn_noise -= in_p->turn_noise;
    rest->duration_us -= in_p->duration_us;
}

/*
 * Propagate `p` over the open slot up to now. A tick's noise is added after its motion: on average the noise of n ticks
 * is transported by (n - 1) / 2n of their motion. So that fraction is added before. `error_states` is a constant, so
 * that the loops are unrolled.
 */
static inline __attribute__((always_inline)) void propagate_covariance(omni_pose_ekf_state_t *state,
                                                                       const omni_pose_ekf_config_t *config,
                                                                       const omni_kinematics_t *k, uint8_t slip_states,
                                                                       uint8_t error_states) {
    omni_real_t(*p)[OMNI_EKF_STATES] = state->p;
    const bool has_gyro = error_states == OMNI_EKF_ERROR_STATES;
    const omni_real_t share = omni_ekf_noise_motion_fraction(state->unpropagated_ticks);
    omni_ekf_slot_t rest;
    complete_slot_jacobian(state, k, slip_states, has_gyro);
    find_unpropagated_motion(state, error_states, &rest);
    const omni_real_t cosine = state->slot_cosine;
    const omni_real_t sine = state->slot_sine;
    const omni_real_t moved[2] = {cosine * rest.move[0] - sine * rest.move[1],
                                  sine * rest.move[0] + cosine * rest.move[1]};
    omni_real_t gain[OMNI_AXES][OMNI_EKF_ERROR_STATES]; /* world frame */
    for (uint8_t i = 0; i < error_states; ++i) {
        gain[0][i] = cosine * rest.jacobian[0][i] - sine * rest.jacobian[1][i];
        gain[1][i] = sine * rest.jacobian[0][i] + cosine * rest.jacobian[1][i];
        gain[2][i] = rest.jacobian[2][i];
    }
    const omni_real_t xy_noise = config->q_xy * rest.steps;
    const omni_real_t turn_noise =
        has_gyro ? take_due_gyro_noise(state, rest.turn_noise) : config->q_theta * rest.steps;
    omni_real_t with_noise[OMNI_MAX_WHEELS]; /* one rounding per slot */
    for (uint8_t i = 0; i < error_states && i < OMNI_MAX_WHEELS; ++i) {
        omni_real_t *variance = &p[OMNI_AXES + i][OMNI_AXES + i];
        with_noise[i] = *variance + rest.slip_noise[i];
        *variance += share * rest.slip_noise[i];
    }
    p[2][2] += share * turn_noise;
    propagate_pose_covariance(state, moved);
    propagate_slip_covariance(state, moved, gain, error_states);
    p[0][0] += xy_noise;
    p[1][1] += xy_noise;
    p[2][2] += (1.0f - share) * turn_noise;
    for (uint8_t i = 0; i < error_states && i < OMNI_MAX_WHEELS; ++i) {
        p[OMNI_AXES + i][OMNI_AXES + i] = with_noise[i];
    }
    if (has_gyro) {
        const int bias = OMNI_AXES + OMNI_EKF_GYRO_BIAS;
        p[bias][bias] += config->q_bias * ((omni_real_t)rest.duration_us * 1e-6f / config->step_s);
    }
    p[1][0] = p[0][1];
    p[2][0] = p[0][2];
    p[2][1] = p[1][2];
    state->unpropagated_ticks = 0;
}

/*
 * Four wheels: n^T (r phi) = n^T (s r phi) over the slot is a scalar measurement of the slip ratios. Its sensitivity
 * uses the wheels' motion without its null component. The quantisation there is already in the innovation. In the
 * sensitivity, too, the product would have a mean, and all ratios would drift towards 1.
 *
 * Only while fixes arrive: see omni/pose_ekf.h.
 */
static inline void correct_with_null_direction(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                               const omni_kinematics_t *k, uint8_t slip_states, uint8_t error_states) {
    const uint8_t states = (uint8_t)(OMNI_AXES + error_states);
    omni_real_t h[OMNI_MAX_WHEELS];
    omni_real_t ph[OMNI_EKF_STATES] = {0};
    omni_real_t residual = 0.0f;
    for (uint8_t i = 0; i < slip_states; ++i) {
        residual += k->null[i] * state->slot_wheel_m[i];
    }
    omni_real_t innovation = residual;
    omni_real_t variance = config->r_null;
    for (uint8_t i = 0; i < slip_states; ++i) {
        h[i] = k->null[i] * (state->slot_wheel_m[i] - k->null[i] * residual);
        innovation -= h[i] * state->error_state[i];
        for (uint8_t a = 0; a < states; ++a) {
            ph[a] += state->p[a][OMNI_AXES + i] * h[i];
        }
    }
    for (uint8_t i = 0; i < slip_states; ++i) {
        variance += h[i] * ph[OMNI_AXES + i];
    }
    omni_real_t delta[OMNI_EKF_STATES];
    for (uint8_t a = 0; a < states; ++a) {
        const omni_real_t gain = ph[a] / variance;
        delta[a] = gain * innovation;
        for (uint8_t b = a; b < states; ++b) {
            state->p[a][b] -= gain * ph[b];
            state->p[b][a] = state->p[a][b];
        }
    }
    /* cppcheck-suppress uninitvar ; at least three states */
    omni_ekf_apply_correction(state, delta, error_states);
}

/* The gyro's turn and noise in this tick; where it is not used the wheels' noise applies. */
static inline void apply_gyro_rate(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                   omni_ekf_motion_t *motion, const omni_ekf_gyro_rate_t *turn, gyro_turn_t *gyro) {
    gyro->duration_s = motion->steps * config->step_s;
    gyro->unscaled = (turn->rate_rad_s - state->error_state[OMNI_EKF_GYRO_BIAS]) * gyro->duration_s;
    gyro->turned_rad = (1.0f + state->error_state[OMNI_EKF_GYRO_SCALE]) * gyro->unscaled;
    gyro->overrides_wheels = turn->overrides_wheels;
    const omni_real_t q_wheels = config->q_theta * state->pose_noise_factor;
    motion->turn_noise = (turn->overrides_wheels || turn->at_rest ? config->q_gyro : q_wheels) * motion->steps;
    state->slot_gyro_rad += turn->rate_rad_s * gyro->duration_s;
    state->slot_gyro_s += gyro->duration_s;
    state->slot_rest_ticks += turn->at_rest ? 1.0f : 0.0f;
    state->slot_gyro_ticks += turn->overrides_wheels ? 1.0f : 0.0f;
}

/* At the end of a slot: in dead reckoning the next slots have more noise, and a slot without motion of wheels and gyro
 * has none. With fixes a robot may have been moved unseen, so this applies without them only. Noise that is already in
 * `p` is not removed. */
static inline void update_noise_at_slot_end(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config) {
    omni_ekf_slot_t *slot = &state->history[state->open_slot];
    state->pose_noise_factor = state->noise_factor;
    if (omni_ekf_is_dead_reckoning(state->last_absolute_update_us, state->time_us)) {
        const omni_flag_t still = slot->move[0] == 0.0f && slot->move[1] == 0.0f && slot->move[2] == 0.0f;
        const bool anew = state->unpropagated_ticks == state->slot_ticks;
        slot->steps = omni_select(still, anew ? 0.0f : state->last_propagated_slot.steps, slot->steps);
        slot->turn_noise = omni_select(still, anew ? 0.0f : state->last_propagated_slot.turn_noise, slot->turn_noise);
        state->pose_noise_factor = state->noise_factor * (1.0f + config->dead_reckoning_noise);
    }
}

/* D of omni/pose_ekf.h. */
static inline void add_distance(omni_pose_ekf_state_t *state, const omni_kinematics_t *k) {
    const omni_real_t *move = state->history[state->open_slot].move;
    state->distance_since_fix_m += omni_absf(move[0]) + omni_absf(move[1]) + omni_lever_arm_m(k) * omni_absf(move[2]);
}

/* @param turn the gyro's rate; NULL: no gyro. */
static inline void predict_motion(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                  const omni_kinematics_t *k, const omni_real_t *wheel_delta_rad,
                                  const omni_ekf_gyro_rate_t *turn, uint64_t time_us) {
    static const omni_real_t still[OMNI_MAX_WHEELS] = {0};
    const omni_real_t *turned = omni_all_finite(wheel_delta_rad, OMNI_MAX_WHEELS) ? wheel_delta_rad : still;
    const uint8_t slip_states = omni_ekf_slips(config, k);
    const bool has_gyro = turn != NULL;
    const uint8_t error_states = has_gyro ? (uint8_t)OMNI_EKF_ERROR_STATES : slip_states;
    if (state->mode != config->mode || state->error_states != error_states) {
        omni_ekf_reconfigure_states(state, config, k, error_states);
    }
    omni_ekf_motion_t motion;
    gyro_turn_t gyro; /* only with one */
    set_elapsed_time(state, config, time_us, &motion);
    if (has_gyro) {
        apply_gyro_rate(state, config, &motion, turn, &gyro);
    }
    move_body(state, k, turned, slip_states, has_gyro ? &gyro : NULL, &motion);
    accumulate_slot(state, config, k, turned, slip_states, has_gyro ? &gyro : NULL, &motion);
    move_pose(state, motion.move);
    if (omni_ekf_history_add(state, &motion, has_gyro)) {
        update_noise_at_slot_end(state, config);
        add_distance(state, k);
        omni_ekf_propagate_covariance(state, config, k, slip_states, error_states);
        if (slip_states > 0 && k->has_null && config->r_null > 0.0f && omni_ekf_has_fixes(state)) {
            correct_with_null_direction(state, config, k, slip_states, error_states);
        }
        if (has_gyro) {
            omni_ekf_correct_with_gyro(state, config, k, slip_states);
        }
        if (config->mean_reversion > 0.0f) {
            omni_ekf_update_slip_means(state, config, slip_states);
        }
        omni_ekf_history_next(state);
    }
}

#endif
