/* SPDX-License-Identifier: MIT */
/**
 * @file pose_ekf_motion.h
 * A tick of the pose EKF's motion, with and without a gyro. Two sources include it, each for one of the two. So robots
 * without a gyro do not pay for it. Not part of the API.
 */
#ifndef OMNI_POSE_EKF_MOTION_H
#define OMNI_POSE_EKF_MOTION_H

#include "../model/kinematics_inline.h"
#include "pose_ekf_internal.h"

/* 2 pi = whole_turn + whole_turn_rest. */
static const omni_real_t whole_turn = 6.28318530717958647692f;
static const omni_real_t whole_turn_rest = -1.74845553e-7f;

/* sum + carry += increment, with the part that rounding drops kept in carry. */
static inline void add_compensated(omni_real_t *sum, omni_real_t *carry, omni_real_t increment) {
    const omni_real_t whole = increment + *carry;
    const omni_real_t next = *sum + whole;
    *carry = whole - (next - *sum);
    *sum = next;
}

static inline void move_pose(omni_pose_ekf_state_t *state, const omni_real_t *delta) {
    omni_pose_t *pose = &state->pose;
    add_compensated(&pose->x, &state->carry[0], delta[0]);
    add_compensated(&pose->y, &state->carry[1], delta[1]);
    add_compensated(&pose->theta, &state->carry[2], delta[2]);
    const omni_flag_t above = pose->theta >= OMNI_PI_F;
    const omni_flag_t below = pose->theta < -OMNI_PI_F;
    if (omni_any(above)) {
        pose->theta = omni_select(above, pose->theta - whole_turn, pose->theta);
        state->carry[2] = omni_select(above, state->carry[2] - whole_turn_rest, state->carry[2]);
    }
    if (omni_any(below)) {
        pose->theta = omni_select(below, pose->theta + whole_turn, pose->theta);
        state->carry[2] = omni_select(below, state->carry[2] + whole_turn_rest, state->carry[2]);
    }
    if (omni_absf(pose->theta) > OMNI_PI_F) {
        pose->theta = omni_wrap_pi(pose->theta);
    }
}

/* What a gyro says of a tick. */
typedef struct follow_t {
    omni_flag_t leads;      /* it gives the turn in place of the wheels */
    omni_real_t turned_rad; /* bias taken off, scale put right */
    omni_real_t unscaled;   /* the same before the scale is put right */
    omni_real_t duration_s;
} follow_t;

static inline void set_elapsed_time(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                    uint64_t time_us, omni_ekf_motion_t *motion) {
    const uint64_t longest_us = 1000000000;
    const omni_real_t nominal_us = config->step_s * 1e6f;
    if (state->time_us == 0) {
        state->told_us = time_us;
        motion->duration_us = (uint32_t)(nominal_us + 0.5f);
    } else {
        const uint64_t elapsed = time_us > state->time_us ? time_us - state->time_us : 0;
        motion->duration_us = (uint32_t)(elapsed < longest_us ? elapsed : longest_us);
    }
    motion->steps = (omni_real_t)motion->duration_us / nominal_us;
    motion->slip_steps = motion->steps * state->slip_factor;
    motion->noise_steps = motion->steps * state->white_factor;
    state->time_us = time_us;
}

/* eq. 22 with slip, over a tick. */
static inline void move_body(const omni_pose_ekf_state_t *state, const omni_kinematics_t *k,
                             const omni_real_t *wheel_delta_rad, uint8_t slips, const follow_t *gyro,
                             omni_ekf_motion_t *motion) {
    omni_real_t slip_m[OMNI_MAX_WHEELS];
    omni_twist_t body;
#ifdef __clang_analyzer__ /* it does not know that there is no slip, or one per wheel */
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        slip_m[i] = 0.0f;
    }
#endif
    for (uint8_t i = 0; i < slips; ++i) {
        slip_m[i] = state->slip[i] * k->radius_m[i] * wheel_delta_rad[i];
    }
    omni_kinematics_forward(k, wheel_delta_rad, slips > 0 ? slip_m : NULL, &body);
    if (gyro != NULL) {
        body.wz = omni_select(gyro->leads, gyro->turned_rad, body.wz);
    }
    omni_real_t sine;
    omni_real_t cosine;
    omni_sincosf(state->pose.theta + (state->carry[2] + 0.5f * body.wz), &sine, &cosine);
    motion->move[0] = cosine * body.vx - sine * body.vy;
    motion->move[1] = sine * body.vx + cosine * body.vy;
    motion->move[2] = body.wz;
}

/* What the tick adds to the open slot, beside its motion. With a gyro, how the turn changes with slip ratios, bias and
 * scale depends on whether the gyro leads it. So it is summed here; the rest waits for `close_gain`. */
static inline void add_to_slot(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                               const omni_kinematics_t *k, const omni_real_t *wheel_delta_rad, uint8_t slips,
                               const follow_t *gyro, const omni_ekf_motion_t *motion) {
    omni_ekf_slot_t *slot = &state->history[state->newest];
    for (uint8_t i = 0; i < slips; ++i) {
        const omni_real_t rolled = k->radius_m[i] * wheel_delta_rad[i];
        const omni_flag_t known = state->p[OMNI_AXES + i][OMNI_AXES + i] < config->p_slip;
        slot->noise[i] += omni_select(rolled != 0.0f && known, config->q_slip * motion->slip_steps, 0.0f);
        state->wheel_m[i] += rolled;
        if (gyro != NULL) {
            slot->gain[2][i] -= omni_select(gyro->leads, 0.0f, k->b_pinv[2][i] * rolled);
        }
    }
    if (gyro != NULL) {
        const omni_real_t scale = 1.0f + state->slip[OMNI_EKF_SCALE];
        slot->gain[2][OMNI_EKF_BIAS] -= omni_select(gyro->leads, gyro->duration_s * scale, 0.0f);
        slot->gain[2][OMNI_EKF_SCALE] += omni_select(gyro->leads, gyro->unscaled, 0.0f);
    }
}

/*
 * How the open slot's motion changes with each slip ratio, bias and scale: its `gain`. A wheel moves the body along its
 * column of B+, seen from the heading of mid-way. What turns the body turns half of the motion with it. Ticks that
 * differ within a slot change that by less than the counts' resolution.
 */
static inline void close_gain(omni_pose_ekf_state_t *state, const omni_kinematics_t *k, uint8_t slips, bool has_gyro) {
    omni_ekf_slot_t *slot = &state->history[state->newest];
    const omni_real_t half_turn = omni_clampf(0.5f * slot->move[2], -0.5f, 0.5f);
    const omni_real_t cosine = 1.0f - 0.5f * half_turn * half_turn;
    const omni_real_t sine = half_turn - half_turn * half_turn * half_turn * (1.0f / 6.0f);
    const omni_real_t arm[2] = {0.5f * slot->move[0], 0.5f * slot->move[1]};
    for (uint8_t i = 0; i < slips; ++i) {
        const omni_real_t along = k->b_pinv[0][i] * state->wheel_m[i];
        const omni_real_t across = k->b_pinv[1][i] * state->wheel_m[i];
        if (!has_gyro) {
            slot->gain[2][i] = -k->b_pinv[2][i] * state->wheel_m[i];
        }
        slot->gain[0][i] = sine * across - cosine * along - arm[1] * slot->gain[2][i];
        slot->gain[1][i] = arm[0] * slot->gain[2][i] - sine * along - cosine * across;
    }
    for (int i = OMNI_EKF_BIAS; has_gyro && i <= OMNI_EKF_SCALE; ++i) {
        slot->gain[0][i] = -arm[1] * slot->gain[2][i];
        slot->gain[1][i] = arm[0] * slot->gain[2][i];
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
                                             omni_real_t gain[OMNI_AXES][OMNI_EKF_COLUMNS], uint8_t columns) {
    omni_real_t(*p)[OMNI_EKF_STATES] = state->p;
    omni_real_t before[OMNI_AXES][OMNI_EKF_COLUMNS];
    for (uint8_t i = 0; i < columns; ++i) {
        const uint8_t column = (uint8_t)(OMNI_AXES + i);
        transport_covariance(&p[0][column], &p[1][column], p[2][column], moved);
        for (int a = 0; a < OMNI_AXES; ++a) {
            before[a][i] = p[a][column];
            for (uint8_t j = 0; j < columns; ++j) {
                p[a][column] += gain[a][j] * p[OMNI_AXES + j][column];
            }
            p[column][a] = p[a][column];
        }
    }
    for (int a = 0; a < OMNI_AXES; ++a) {
        for (int b = a; b < OMNI_AXES; ++b) {
            for (uint8_t i = 0; i < columns; ++i) {
                p[a][b] += before[a][i] * gain[b][i] + gain[a][i] * p[b][OMNI_AXES + i];
            }
        }
    }
}

/* The gyro's noise of a slot is less than the last bit of theta's variance. It waits until it is not. */
static inline omni_real_t due_turn_noise(omni_pose_ekf_state_t *state, omni_real_t more) {
    const omni_real_t waiting = state->turn_noise + more;
    const omni_flag_t due = waiting >= state->p[2][2] * 1e-5f;
    state->turn_noise = omni_select(due, 0.0f, waiting);
    return omni_select(due, waiting, 0.0f);
}

/* What the open slot holds and `p` does not: all of it, or what came since `p` was settled. Motions in a row compose:
 * gain = F_rest gain_settled + gain_rest. */
static inline void find_unsettled(const omni_pose_ekf_state_t *state, uint8_t columns, omni_ekf_slot_t *rest) {
    const omni_ekf_slot_t *slot = &state->history[state->newest];
    const omni_ekf_slot_t *in_p = &state->settled;
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        rest->move[axis] = slot->move[axis];
        for (uint8_t i = 0; i < columns; ++i) {
            rest->gain[axis][i] = slot->gain[axis][i];
        }
    }
    for (uint8_t i = 0; i < columns && i < OMNI_MAX_WHEELS; ++i) {
        rest->noise[i] = slot->noise[i];
    }
    rest->steps = slot->steps;
    rest->turn_noise = slot->turn_noise;
    rest->duration_us = slot->duration_us;
    if (state->unsettled_ticks == state->slot_tick) {
        return;
    }
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        rest->move[axis] -= in_p->move[axis];
    }
    for (uint8_t i = 0; i < columns; ++i) {
        for (int axis = 0; axis < OMNI_AXES; ++axis) {
            rest->gain[axis][i] -= in_p->gain[axis][i];
        }
        rest->gain[0][i] += rest->move[1] * in_p->gain[2][i];
        rest->gain[1][i] -= rest->move[0] * in_p->gain[2][i];
    }
    for (uint8_t i = 0; i < columns && i < OMNI_MAX_WHEELS; ++i) {
        rest->noise[i] -= in_p->noise[i];
    }
    rest->steps -= in_p->steps;
    rest->turn_noise -= in_p->turn_noise;
    rest->duration_us -= in_p->duration_us;
}

/*
 * `p` follows the motion of the open slot up to now. A tick's noise enters after its motion: in the mean the noise of n
 * ticks sees (n - 1) / 2n of their motion. So that share of it is added before. `columns` is a constant, so that the
 * loops are unrolled.
 */
static inline __attribute__((always_inline)) void settle_columns(omni_pose_ekf_state_t *state,
                                                                 const omni_pose_ekf_config_t *config,
                                                                 const omni_kinematics_t *k, uint8_t slips,
                                                                 uint8_t columns) {
    omni_real_t(*p)[OMNI_EKF_STATES] = state->p;
    const bool has_gyro = columns == OMNI_EKF_COLUMNS;
    const omni_real_t share = omni_ekf_noise_share(state->unsettled_ticks);
    omni_ekf_slot_t rest;
    close_gain(state, k, slips, has_gyro);
    find_unsettled(state, columns, &rest);
    const omni_real_t cosine = state->slot_cosine;
    const omni_real_t sine = state->slot_sine;
    const omni_real_t moved[2] = {cosine * rest.move[0] - sine * rest.move[1],
                                  sine * rest.move[0] + cosine * rest.move[1]};
    omni_real_t gain[OMNI_AXES][OMNI_EKF_COLUMNS]; /* world frame */
    for (uint8_t i = 0; i < columns; ++i) {
        gain[0][i] = cosine * rest.gain[0][i] - sine * rest.gain[1][i];
        gain[1][i] = sine * rest.gain[0][i] + cosine * rest.gain[1][i];
        gain[2][i] = rest.gain[2][i];
    }
    const omni_real_t xy_noise = config->q_xy * rest.steps;
    const omni_real_t turn_noise = has_gyro ? due_turn_noise(state, rest.turn_noise) : config->q_theta * rest.steps;
    omni_real_t with_noise[OMNI_MAX_WHEELS]; /* one rounding per slot */
    for (uint8_t i = 0; i < columns && i < OMNI_MAX_WHEELS; ++i) {
        omni_real_t *variance = &p[OMNI_AXES + i][OMNI_AXES + i];
        with_noise[i] = *variance + rest.noise[i];
        *variance += share * rest.noise[i];
    }
    p[2][2] += share * turn_noise;
    propagate_pose_covariance(state, moved);
    propagate_slip_covariance(state, moved, gain, columns);
    p[0][0] += xy_noise;
    p[1][1] += xy_noise;
    p[2][2] += (1.0f - share) * turn_noise;
    for (uint8_t i = 0; i < columns && i < OMNI_MAX_WHEELS; ++i) {
        p[OMNI_AXES + i][OMNI_AXES + i] = with_noise[i];
    }
    if (has_gyro) {
        const int bias = OMNI_AXES + OMNI_EKF_BIAS;
        p[bias][bias] += config->q_bias * ((omni_real_t)rest.duration_us * 1e-6f / config->step_s);
    }
    p[1][0] = p[0][1];
    p[2][0] = p[0][2];
    p[2][1] = p[1][2];
    state->unsettled_ticks = 0;
}

/*
 * Four wheels: n^T (r phi) = n^T (s r phi) over the slot is a scalar measurement of the slip ratios. Its sensitivity
 * takes the wheels' motion without its null component. The counts' rounding there is in the innovation already. If it
 * were in the gain too, the product would not average out, and all ratios would creep towards 1.
 *
 * Only while fixes come: see omni/pose_ekf.h.
 */
static inline void use_null(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                            const omni_kinematics_t *k, uint8_t slips, uint8_t columns) {
    const uint8_t states = (uint8_t)(OMNI_AXES + columns);
    omni_real_t h[OMNI_MAX_WHEELS];
    omni_real_t ph[OMNI_EKF_STATES] = {0};
    omni_real_t residual = 0.0f;
    for (uint8_t i = 0; i < slips; ++i) {
        residual += k->null[i] * state->wheel_m[i];
    }
    omni_real_t innovation = residual;
    omni_real_t variance = config->r_null;
    for (uint8_t i = 0; i < slips; ++i) {
        h[i] = k->null[i] * (state->wheel_m[i] - k->null[i] * residual);
        innovation -= h[i] * state->slip[i];
        for (uint8_t a = 0; a < states; ++a) {
            ph[a] += state->p[a][OMNI_AXES + i] * h[i];
        }
    }
    for (uint8_t i = 0; i < slips; ++i) {
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
    omni_ekf_shift(state, delta, columns);
}

/* What the gyro says of the tick, and the noise it brings; where it says nothing the wheels' noise counts. */
static inline void follow_gyro(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                               omni_ekf_motion_t *motion, const omni_ekf_turn_t *turn, follow_t *gyro) {
    gyro->duration_s = motion->steps * config->step_s;
    gyro->unscaled = (turn->rate_rad_s - state->slip[OMNI_EKF_BIAS]) * gyro->duration_s;
    gyro->turned_rad = (1.0f + state->slip[OMNI_EKF_SCALE]) * gyro->unscaled;
    gyro->leads = turn->leads;
    const omni_real_t q_wheels = config->q_theta * state->white_factor;
    motion->turn_noise = omni_select(turn->leads || turn->rest, config->q_turn, q_wheels) * motion->steps;
    state->slot_turn_rad += turn->rate_rad_s * gyro->duration_s;
    state->slot_turn_s += gyro->duration_s;
    state->slot_rest += omni_select(turn->rest, 1.0f, 0.0f);
    state->slot_turns += omni_select(turn->leads, 1.0f, 0.0f);
}

/* The slot is complete. From the next one on, x, y and theta have more noise without fixes. If neither wheel nor gyro
 * has moved the robot in this one, there is nothing that noise could be of. A pose fix may know better, so this holds
 * without fixes only. What is in `p` already stays. */
static inline void end_noise(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config) {
    omni_ekf_slot_t *slot = &state->history[state->newest];
    state->white_factor = state->noise_factor;
    if (omni_ekf_is_alone(state->told_us, state->time_us)) {
        const omni_flag_t still = slot->move[0] == 0.0f && slot->move[1] == 0.0f && slot->move[2] == 0.0f;
        const bool anew = state->unsettled_ticks == state->slot_tick;
        slot->steps = omni_select(still, anew ? 0.0f : state->settled.steps, slot->steps);
        slot->turn_noise = omni_select(still, anew ? 0.0f : state->settled.turn_noise, slot->turn_noise);
        state->white_factor = state->noise_factor * (1.0f + config->alone);
    }
}

/* D of omni/pose_ekf.h. */
static inline void add_distance(omni_pose_ekf_state_t *state, const omni_kinematics_t *k) {
    const omni_real_t *move = state->history[state->newest].move;
    state->since_fix_m += omni_absf(move[0]) + omni_absf(move[1]) + k->b[0][2] * omni_absf(move[2]);
}

/* @param turn what a gyro says; NULL: there is none. */
static inline void predict_motion(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                  const omni_kinematics_t *k, const omni_real_t *wheel_delta_rad,
                                  const omni_ekf_turn_t *turn, uint64_t time_us) {
    static const omni_real_t still[OMNI_MAX_WHEELS] = {0};
    const omni_real_t *turned = omni_all_finite(wheel_delta_rad, OMNI_MAX_WHEELS) ? wheel_delta_rad : still;
    const uint8_t slips = omni_ekf_slips(config, k);
    const bool has_gyro = turn != NULL;
    const uint8_t columns = has_gyro ? (uint8_t)OMNI_EKF_COLUMNS : slips;
    if (state->mode != config->mode || state->columns != columns) {
        omni_ekf_change_states(state, config, k, columns);
    }
    omni_ekf_motion_t motion;
    follow_t gyro; /* only with one */
    set_elapsed_time(state, config, time_us, &motion);
    if (has_gyro) {
        follow_gyro(state, config, &motion, turn, &gyro);
    }
    move_body(state, k, turned, slips, has_gyro ? &gyro : NULL, &motion);
    add_to_slot(state, config, k, turned, slips, has_gyro ? &gyro : NULL, &motion);
    move_pose(state, motion.move);
    if (omni_ekf_history_add(state, &motion, has_gyro)) {
        end_noise(state, config);
        add_distance(state, k);
        omni_ekf_settle(state, config, k, slips, columns);
        if (slips > 0 && k->has_null && config->r_null > 0.0f && omni_ekf_has_fixes(state)) {
            use_null(state, config, k, slips, columns);
        }
        if (has_gyro) {
            omni_ekf_use_turn(state, config, k, slips);
        }
        if (config->mean_rate > 0.0f) {
            omni_ekf_follow_mean(state, config, slips);
        }
        omni_ekf_history_next(state);
    }
}

#endif
