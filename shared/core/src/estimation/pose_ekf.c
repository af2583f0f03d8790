/* SPDX-License-Identifier: MIT */
#include "omni/pose_ekf.h"

#include <string.h>

#include "../kinematics/kinematics_inline.h"
#include "pose_ekf_internal.h"

/* A ratio beyond this is no slip any more: the wheel spins or is blocked, and the model says nothing. */
static const omni_real_t slip_limit = 0.5f;

/* 2 pi = whole_turn + whole_turn_rest. */
static const omni_real_t whole_turn = 6.28318530717958647692f;
static const omni_real_t whole_turn_rest = -1.74845553e-7f;

uint8_t omni_ekf_slips(const omni_pose_ekf_config_t *config, const omni_kinematics_t *k) {
    return config->mode == OMNI_EKF_MODE_SLIP ? k->wheels : 0;
}

void omni_ekf_restart_slips(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, uint8_t slips) {
    memset(state->slip, 0, sizeof state->slip);
    for (int a = OMNI_AXES; a < OMNI_EKF_STATES; ++a) {
        for (int b = 0; b < OMNI_EKF_STATES; ++b) {
            state->p[a][b] = 0.0f;
            state->p[b][a] = 0.0f;
        }
        state->p[a][a] = a < OMNI_AXES + slips ? config->p_slip : 0.0f;
    }
}

void omni_pose_ekf_reset(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, const omni_pose_t *pose,
                         omni_real_t sd_xy, omni_real_t sd_theta) {
    memset(state, 0, sizeof *state);
    state->pose = *pose;
    state->pose.theta = omni_wrap_pi(pose->theta);
    state->p[0][0] = sd_xy * sd_xy;
    state->p[1][1] = sd_xy * sd_xy;
    state->p[2][2] = sd_theta * sd_theta;
    state->mode = OMNI_EKF_MODE_POSE;
    if (config->mode != OMNI_EKF_MODE_SLIP) {
        state->mode = config->mode;
    }
    omni_sincosf(state->pose.theta, &state->slot_sine, &state->slot_cosine);
}

void omni_pose_ekf_set_pose(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, const omni_pose_t *pose,
                            uint64_t time_us) {
    omni_pose_ekf_reset(state, config, pose, omni_sqrtf(config->r_xy), omni_sqrtf(config->r_theta));
    state->time_us = time_us;
}

/* sum + carry += increment, with the part that rounding drops kept in carry. */
static void add_compensated(omni_real_t *sum, omni_real_t *carry, omni_real_t increment) {
    const omni_real_t whole = increment + *carry;
    const omni_real_t next = *sum + whole;
    *carry = whole - (next - *sum);
    *sum = next;
}

static void move_pose(omni_pose_ekf_state_t *state, const omni_real_t *delta) {
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

void omni_ekf_shift(omni_pose_ekf_state_t *state, const omni_real_t *delta, uint8_t slips) {
    move_pose(state, delta);
    for (uint8_t i = 0; i < slips; ++i) {
        state->slip[i] = omni_clampf(state->slip[i] + delta[OMNI_AXES + i], -slip_limit, slip_limit);
    }
    omni_ekf_history_rebase(state, slips);
}

static void set_elapsed_time(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, uint64_t time_us,
                             omni_ekf_motion_t *motion) {
    const uint64_t longest_us = 1000000000;
    const omni_real_t nominal_us = config->step_s * 1e6f;
    if (state->time_us == 0) {
        motion->duration_us = (uint32_t)(nominal_us + 0.5f);
    } else {
        const uint64_t elapsed = time_us > state->time_us ? time_us - state->time_us : 0;
        motion->duration_us = (uint32_t)(elapsed < longest_us ? elapsed : longest_us);
    }
    motion->steps = (omni_real_t)motion->duration_us / nominal_us;
    state->time_us = time_us;
}

/* eq. 22 with slip, over a tick; and how the motion changes with each slip ratio, the turn of the mid-tick frame
 * included. */
static void move_body(const omni_pose_ekf_state_t *state, const omni_kinematics_t *k,
                      const omni_real_t *wheel_delta_rad, uint8_t slips, omni_ekf_motion_t *motion) {
    omni_real_t slip_m[OMNI_MAX_WHEELS];
    omni_twist_t body;
    for (uint8_t i = 0; i < slips; ++i) {
        slip_m[i] = state->slip[i] * k->radius_m[i] * wheel_delta_rad[i];
    }
    omni_kinematics_forward(k, wheel_delta_rad, slips > 0 ? slip_m : NULL, &body);
    motion->move[0] = body.vx;
    motion->move[1] = body.vy;
    motion->move[2] = body.wz;
    for (uint8_t i = 0; i < slips; ++i) {
        const omni_real_t rolled = k->radius_m[i] * wheel_delta_rad[i];
        const omni_real_t turned = -k->b_pinv[2][i] * rolled;
        motion->gain[0][i] = -k->b_pinv[0][i] * rolled - 0.5f * body.vy * turned;
        motion->gain[1][i] = -k->b_pinv[1][i] * rolled + 0.5f * body.vx * turned;
        motion->gain[2][i] = turned;
    }
    omni_sincosf(state->pose.theta + (state->carry[2] + 0.5f * body.wz), &motion->sine, &motion->cosine);
}

static omni_real_t world_x(const omni_ekf_motion_t *motion, omni_real_t x, omni_real_t y) {
    return motion->cosine * x - motion->sine * y;
}

static omni_real_t world_y(const omni_ekf_motion_t *motion, omni_real_t x, omni_real_t y) {
    return motion->sine * x + motion->cosine * y;
}

/* value = F value for a column (x, y, theta), F = 1, -dy; 1, dx; 1. */
static void transport_covariance(omni_real_t *x, omni_real_t *y, omni_real_t theta, const omni_real_t *moved) {
    *x -= moved[1] * theta;
    *y += moved[0] * theta;
}

/* P_pp = F P_pp F^T + Q (eq. 62); only the upper triangle is computed. */
static void propagate_pose_covariance(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                      const omni_real_t *moved, omni_real_t steps) {
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
    p[2][2] += config->q_theta * steps;
}

/* With A = F P_ps and P_ps' = A + G P_ss:  P_pp += A G^T + G P_ps'^T,  P_ps = P_ps', P_ss += Q_ss. */
static inline void propagate_slip_covariance(omni_pose_ekf_state_t *state, const omni_ekf_motion_t *motion,
                                             const omni_real_t *moved, omni_real_t gain[OMNI_AXES][OMNI_MAX_WHEELS],
                                             uint8_t slips) {
    omni_real_t(*p)[OMNI_EKF_STATES] = state->p;
    omni_real_t before[OMNI_AXES][OMNI_MAX_WHEELS];
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

static void propagate_covariance(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                 const omni_ekf_motion_t *motion, const omni_real_t *moved, uint8_t slips) {
    omni_real_t(*p)[OMNI_EKF_STATES] = state->p;
    omni_real_t gain[OMNI_AXES][OMNI_MAX_WHEELS];
    for (uint8_t i = 0; i < slips; ++i) {
        gain[0][i] = world_x(motion, motion->gain[0][i], motion->gain[1][i]);
        gain[1][i] = world_y(motion, motion->gain[0][i], motion->gain[1][i]);
        gain[2][i] = motion->gain[2][i];
    }
    propagate_pose_covariance(state, config, moved, motion->steps);
    /* The count as a constant lets the compiler unroll the loops. */
    if (slips == 3) {
        propagate_slip_covariance(state, motion, moved, gain, 3);
    } else if (slips == 4) {
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
static void use_null(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, const omni_kinematics_t *k,
                     uint8_t slips) {
    const uint8_t states = (uint8_t)(OMNI_AXES + slips);
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
    omni_ekf_shift(state, delta, slips);
}

void omni_pose_ekf_predict(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                           const omni_kinematics_t *k, const omni_real_t *wheel_delta_rad, uint64_t time_us) {
    static const omni_real_t still[OMNI_MAX_WHEELS] = {0};
    const omni_real_t *turned = omni_all_finite(wheel_delta_rad, k->wheels) ? wheel_delta_rad : still;
    const uint8_t slips = omni_ekf_slips(config, k);
    if (state->mode != config->mode) {
        omni_ekf_restart_slips(state, config, slips);
        omni_ekf_history_rebase(state, 0);
        state->mode = config->mode;
    }
    omni_ekf_motion_t motion; /* per wheel: as many entries as there are slip states */
    set_elapsed_time(state, config, time_us, &motion);
    move_body(state, k, turned, slips, &motion);
    for (uint8_t i = 0; i < slips; ++i) {
        const omni_flag_t known = state->p[OMNI_AXES + i][OMNI_AXES + i] < config->p_slip;
        motion.noise[i] = omni_select(turned[i] != 0.0f && known, config->q_slip * motion.steps, 0.0f);
        state->wheel_m[i] += k->radius_m[i] * turned[i];
    }
    const omni_real_t moved[OMNI_AXES] = {world_x(&motion, motion.move[0], motion.move[1]),
                                          world_y(&motion, motion.move[0], motion.move[1]), motion.move[2]};
    propagate_covariance(state, config, &motion, moved, slips);
    move_pose(state, moved);
    if (omni_ekf_history_add(state, &motion, slips)) {
        if (slips > 0 && k->has_null && config->r_null > 0.0f) {
            use_null(state, config, k, slips);
        }
        omni_ekf_history_next(state);
    }
}
