/* SPDX-License-Identifier: MIT */
/**
 * @file pose_ekf_motion.h
 * A tick of the pose EKF's motion, with and without a gyro. Two sources include it, each for one of the two. So robots
 * without a gyro do not pay for it. Not part of the API.
 */
#ifndef OMNI_POSE_EKF_MOTION_H
#define OMNI_POSE_EKF_MOTION_H

#include "../kinematics/kinematics_inline.h"
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
    omni_real_t duration_s;
    omni_real_t turn_noise; /* variance added to theta */
    omni_real_t bias_noise;
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
    const bool alone = omni_ekf_is_alone(state->told_us, time_us);
    state->white_factor = alone ? state->noise_factor * (1.0f + config->alone) : state->noise_factor;
    motion->slip_steps = motion->steps * state->noise_factor;
    motion->noise_steps = motion->steps * state->white_factor;
    state->time_us = time_us;
}

/* eq. 22 with slip, over a tick; and how the motion changes with each slip ratio, the turn of the mid-tick frame
 * included. */
static inline void move_body(const omni_pose_ekf_state_t *state, const omni_kinematics_t *k,
                             const omni_real_t *wheel_delta_rad, uint8_t slips, const follow_t *gyro,
                             omni_ekf_motion_t *motion) {
    omni_real_t slip_m[OMNI_MAX_WHEELS];
    omni_twist_t body;
    for (uint8_t i = 0; i < slips; ++i) {
        slip_m[i] = state->slip[i] * k->radius_m[i] * wheel_delta_rad[i];
    }
    omni_kinematics_forward(k, wheel_delta_rad, slips > 0 ? slip_m : NULL, &body);
    if (gyro != NULL) {
        body.wz = omni_select(gyro->leads, gyro->turned_rad, body.wz);
    }
    motion->move[0] = body.vx;
    motion->move[1] = body.vy;
    motion->move[2] = body.wz;
    for (uint8_t i = 0; i < slips; ++i) {
        const omni_real_t rolled = k->radius_m[i] * wheel_delta_rad[i];
        omni_real_t turned = -k->b_pinv[2][i] * rolled;
        if (gyro != NULL) {
            turned = omni_select(gyro->leads, 0.0f, turned);
        }
        motion->gain[0][i] = -k->b_pinv[0][i] * rolled - 0.5f * body.vy * turned;
        motion->gain[1][i] = -k->b_pinv[1][i] * rolled + 0.5f * body.vx * turned;
        motion->gain[2][i] = turned;
    }
    omni_sincosf(state->pose.theta + (state->carry[2] + 0.5f * body.wz), &motion->sine, &motion->cosine);
}

static inline omni_real_t world_x(const omni_ekf_motion_t *motion, omni_real_t x, omni_real_t y) {
    return motion->cosine * x - motion->sine * y;
}

static inline omni_real_t world_y(const omni_ekf_motion_t *motion, omni_real_t x, omni_real_t y) {
    return motion->sine * x + motion->cosine * y;
}

/* How motion that the gyro leads changes with its bias and scale. Slip ratios that are not in use change nothing. */
static inline void add_gyro(const omni_pose_ekf_state_t *state, const follow_t *gyro, uint8_t slips,
                            omni_ekf_motion_t *motion) {
    for (int i = slips; i < OMNI_EKF_COLUMNS; ++i) {
        motion->gain[0][i] = 0.0f;
        motion->gain[1][i] = 0.0f;
        motion->gain[2][i] = 0.0f;
        motion->noise[i] = 0.0f;
    }
    const omni_real_t scale = 1.0f + state->slip[OMNI_EKF_SCALE];
    const omni_real_t turned[2] = {-gyro->duration_s * scale, gyro->turned_rad / scale};
    for (int i = 0; i < 2; ++i) {
        const omni_real_t turn = omni_select(gyro->leads, turned[i], 0.0f);
        motion->gain[0][OMNI_EKF_BIAS + i] = -0.5f * motion->move[1] * turn;
        motion->gain[1][OMNI_EKF_BIAS + i] = 0.5f * motion->move[0] * turn;
        motion->gain[2][OMNI_EKF_BIAS + i] = turn;
    }
    motion->noise[OMNI_EKF_BIAS] = gyro->bias_noise;
    motion->turn_noise = gyro->turn_noise;
}

/* value = F value for a column (x, y, theta), F = 1, -dy; 1, dx; 1. */
static inline void transport_covariance(omni_real_t *x, omni_real_t *y, omni_real_t theta, const omni_real_t *moved) {
    *x -= moved[1] * theta;
    *y += moved[0] * theta;
}

/* P_pp = F P_pp F^T + Q (eq. 62); only the upper triangle is computed. */
static inline void propagate_pose_covariance(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                             const omni_real_t *moved, omni_real_t steps, omni_real_t turn_noise) {
    omni_real_t(*p)[OMNI_EKF_STATES] = state->p;
    const omni_real_t dx = moved[0];
    const omni_real_t dy = moved[1];
    const omni_real_t xt = p[0][2] - dy * p[2][2];
    const omni_real_t yt = p[1][2] + dx * p[2][2];
    p[0][0] += -dy * (p[0][2] + xt) + config->q_xy * steps;
    p[0][1] += dx * xt - dy * p[1][2];
    p[1][1] += dx * (p[1][2] + yt) + config->q_xy * steps;
    p[0][2] = xt;
    p[1][2] = yt;
    p[2][2] += turn_noise;
}

/* With A = F P_ps and P_ps' = A + G P_ss:  P_pp += A G^T + G P_ps'^T,  P_ps = P_ps', P_ss += Q_ss. */
static inline void propagate_slip_covariance(omni_pose_ekf_state_t *state, const omni_ekf_motion_t *motion,
                                             const omni_real_t *moved, omni_real_t gain[OMNI_AXES][OMNI_EKF_COLUMNS],
                                             uint8_t slips) {
    omni_real_t(*p)[OMNI_EKF_STATES] = state->p;
    omni_real_t before[OMNI_AXES][OMNI_EKF_COLUMNS];
    for (uint8_t i = 0; i < slips; ++i) {
        const uint8_t column = (uint8_t)(OMNI_AXES + i);
        transport_covariance(&p[0][column], &p[1][column], p[2][column], moved);
        for (int a = 0; a < OMNI_AXES; ++a) {
            before[a][i] = p[a][column];
            for (uint8_t j = 0; j < slips; ++j) {
                p[a][column] += gain[a][j] * p[OMNI_AXES + j][column];
            }
            p[column][a] = p[a][column];
        }
    }
    for (int a = 0; a < OMNI_AXES; ++a) {
        for (int b = a; b < OMNI_AXES; ++b) {
            for (uint8_t i = 0; i < slips; ++i) {
                p[a][b] += before[a][i] * gain[b][i] + gain[a][i] * p[b][OMNI_AXES + i];
            }
        }
    }
    for (uint8_t i = 0; i < slips; ++i) {
        p[OMNI_AXES + i][OMNI_AXES + i] += motion->noise[i];
    }
}

/* The gyro's noise of a tick is less than the last bit of theta's variance. It waits until it is not. */
static inline omni_real_t due_turn_noise(omni_pose_ekf_state_t *state, const omni_ekf_motion_t *motion) {
    const omni_real_t waiting = state->turn_noise + motion->turn_noise;
    const omni_flag_t due = waiting >= state->p[2][2] * 1e-5f;
    state->turn_noise = omni_select(due, 0.0f, waiting);
    return omni_select(due, waiting, 0.0f);
}

static inline void propagate_covariance(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                        const omni_ekf_motion_t *motion, const omni_real_t *moved, uint8_t columns) {
    omni_real_t(*p)[OMNI_EKF_STATES] = state->p;
    omni_real_t gain[OMNI_AXES][OMNI_EKF_COLUMNS];
    for (uint8_t i = 0; i < columns; ++i) {
        gain[0][i] = world_x(motion, motion->gain[0][i], motion->gain[1][i]);
        gain[1][i] = world_y(motion, motion->gain[0][i], motion->gain[1][i]);
        gain[2][i] = motion->gain[2][i];
    }
    const omni_real_t turn_noise =
        columns == OMNI_EKF_COLUMNS ? due_turn_noise(state, motion) : config->q_theta * motion->noise_steps;
    propagate_pose_covariance(state, config, moved, motion->noise_steps, turn_noise);
    /* The count as a constant lets the compiler unroll the loops. */
    if (columns == OMNI_EKF_COLUMNS) {
        propagate_slip_covariance(state, motion, moved, gain, OMNI_EKF_COLUMNS);
    } else if (columns == 3) {
        propagate_slip_covariance(state, motion, moved, gain, 3);
    } else if (columns == 4) {
        propagate_slip_covariance(state, motion, moved, gain, 4);
    }
    p[1][0] = p[0][1];
    p[2][0] = p[0][2];
    p[2][1] = p[1][2];
}

/*
 * Four wheels: n^T (r phi) = n^T (s r phi) over the slot is a scalar measurement of the slip ratios. Its sensitivity
 * takes the wheels' motion without its null component. The counts' rounding there is in the innovation already. If it
 * were in the gain too, the product would not average out, and all ratios would creep towards 1.
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
    omni_ekf_shift(state, delta, columns);
}

/* What the gyro says of the tick, and the noise it brings; where it says nothing the wheels' noise counts. */
static inline void follow_gyro(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                               const omni_ekf_motion_t *motion, const omni_ekf_turn_t *turn, follow_t *gyro) {
    gyro->duration_s = motion->steps * config->step_s;
    gyro->turned_rad =
        (1.0f + state->slip[OMNI_EKF_SCALE]) * (turn->rate_rad_s - state->slip[OMNI_EKF_BIAS]) * gyro->duration_s;
    gyro->leads = turn->leads;
    gyro->bias_noise = config->q_bias * motion->steps;
    const omni_real_t q_wheels = config->q_theta * state->white_factor;
    gyro->turn_noise = omni_select(turn->leads || turn->rest, config->q_turn, q_wheels) * motion->steps;
    state->slot_turn_rad += turn->rate_rad_s * gyro->duration_s;
    state->slot_turn_s += gyro->duration_s;
    state->slot_rest += omni_select(turn->rest, 1.0f, 0.0f);
    state->slot_turns += omni_select(turn->leads, 1.0f, 0.0f);
}

/* @param turn what a gyro says; NULL: there is none. */
static inline void predict_motion(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                  const omni_kinematics_t *k, const omni_real_t *wheel_delta_rad,
                                  const omni_ekf_turn_t *turn, uint64_t time_us) {
    static const omni_real_t still[OMNI_MAX_WHEELS] = {0};
    const omni_real_t *turned = omni_all_finite(wheel_delta_rad, k->wheels) ? wheel_delta_rad : still;
    const uint8_t slips = omni_ekf_slips(config, k);
    if (state->mode != config->mode) {
        omni_ekf_restart_slips(state, config, slips);
        omni_ekf_history_rebase(state, 0);
        state->mode = config->mode;
    }
    const bool has_gyro = turn != NULL;
    const uint8_t columns = has_gyro ? (uint8_t)OMNI_EKF_COLUMNS : slips;
    omni_ekf_motion_t motion; /* per wheel: as many entries as there are slip states */
    follow_t gyro;            /* only with one */
    set_elapsed_time(state, config, time_us, &motion);
    if (has_gyro) {
        follow_gyro(state, config, &motion, turn, &gyro);
    }
    move_body(state, k, turned, slips, has_gyro ? &gyro : NULL, &motion);
    if (has_gyro) {
        add_gyro(state, &gyro, slips, &motion);
    }
    for (uint8_t i = 0; i < slips; ++i) {
        const omni_flag_t known = state->p[OMNI_AXES + i][OMNI_AXES + i] < config->p_slip;
        motion.noise[i] = omni_select(turned[i] != 0.0f && known, config->q_slip * motion.slip_steps, 0.0f);
        state->wheel_m[i] += k->radius_m[i] * turned[i];
    }
    const omni_real_t moved[OMNI_AXES] = {world_x(&motion, motion.move[0], motion.move[1]),
                                          world_y(&motion, motion.move[0], motion.move[1]), motion.move[2]};
    propagate_covariance(state, config, &motion, moved, columns);
    move_pose(state, moved);
    if (omni_ekf_history_add(state, &motion, columns)) {
        if (slips > 0 && k->has_null && config->r_null > 0.0f) {
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
