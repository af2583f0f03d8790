/* SPDX-License-Identifier: MIT */
/*
 * Correction by a floor odometry reading: see omni/pose_ekf.h and docs/concepts/derivations/floor_motion.md.
 */
#include "pose_ekf_window.h"

enum { FLOW_ROWS = OMNI_AXES };

static const omni_real_t largest_nis = 1e9f;

/* Correction by one reading. Of arrays with FLOW_ROWS rows, `rows` are used. The rest is zeroed, so that the proof of
 * initialisation (tests/proof) covers all of it. */
typedef struct flow_update_t {
    uint8_t rows; /* 2, or 3 with the turn */
    uint8_t error_states;
    uint8_t states;
    bool gyro;
    uint32_t span_us;            /* total duration of the slots used */
    omni_real_t move[OMNI_AXES]; /* by the wheels: dx, dy, dtheta in the body axes at mid-interval */
    omni_real_t jacobian[OMNI_AXES][OMNI_EKF_ERROR_STATES]; /* d move / d error_state */
    omni_real_t cosine;                                     /* of `theta` */
    omni_real_t sine;
    omni_real_t theta;        /* heading at mid-interval */
    omni_real_t since[2];     /* motion from mid-interval to now, world frame */
    omni_real_t w[OMNI_AXES]; /* process noise of the motion, correlated with the pose: m^2, m^2, rad^2 */
    omni_real_t c[OMNI_AXES]; /* variance of the encoder quantisation */
    omni_real_t r[OMNI_AXES]; /* variance of the reading */
    omni_real_t innovation[FLOW_ROWS];
    omni_real_t h[FLOW_ROWS][OMNI_EKF_ERROR_STATES];
    omni_real_t factor[FLOW_ROWS][FLOW_ROWS];      /* Cholesky factor of S */
    omni_real_t white[FLOW_ROWS];                  /* whitened innovation */
    omni_real_t cross[FLOW_ROWS][OMNI_EKF_STATES]; /* whitened covariance of state and innovation */
} flow_update_t;

/* Iterator over the history slots of a reading, from now to the past. */
typedef struct history_part_t {
    uint32_t skip_us;    /* time still to be skipped: from the end of the interval to now */
    uint32_t left_us;    /* time of the interval still to be covered */
    uint16_t index;      /* history index of the slot */
    uint8_t back;        /* slots visited */
    uint32_t used_us;    /* time of the slot within the interval */
    omni_real_t used;    /* the same as a fraction of the slot */
    omni_real_t skipped; /* fraction of the slot after the interval */
    bool whole;          /* count slots that ended within the interval completely, others not at all */
} history_part_t;

static void begin_history_parts(history_part_t *part, const omni_ekf_flow_t *flow, bool whole) {
    part->whole = whole;
    part->skip_us = flow->age_us;
    part->left_us = flow->span_us;
    part->back = 0;
}

/* @return false at the end of the interval (left_us is 0) or of the history. */
static bool next_history_part(const omni_pose_ekf_state_t *state, history_part_t *part) __attribute__((noinline));

static bool next_history_part(const omni_pose_ekf_state_t *state, history_part_t *part) {
    if (part->left_us == 0 || part->back > state->complete_slots) {
        return false;
    }
    part->index = (uint16_t)((state->open_slot + OMNI_EKF_HISTORY - part->back) % OMNI_EKF_HISTORY);
    const uint32_t duration_us = state->history[part->index].duration_us;
    const uint32_t skipped_us = part->skip_us < duration_us ? part->skip_us : duration_us;
    const uint32_t rest_us = duration_us - skipped_us;
    const omni_real_t all_us = (omni_real_t)(duration_us > 0 ? duration_us : 1u);
    part->used_us = part->left_us < rest_us ? part->left_us : rest_us;
    part->used = (omni_real_t)part->used_us / all_us;
    part->skipped = (omni_real_t)skipped_us / all_us;
    part->skip_us -= skipped_us;
    part->left_us -= part->used_us;
    if (part->whole) {
        const bool ended = skipped_us == 0 && part->back > 0;
        part->used_us = ended ? duration_us : 0;
        part->used = ended ? 1.0f : 0.0f;
        part->skipped = 1.0f - part->used;
    }
    ++part->back;
    return true;
}

/* Motion from span_us + age_us ago to age_us ago, world frame. @param whole see history_part_t. @return false if the
 * history is too short. */
static bool integrate_history_motion(flow_update_t *u, const omni_pose_ekf_state_t *state,
                                     const omni_pose_ekf_config_t *config, const omni_ekf_flow_t *flow,
                                     omni_ekf_window_t *window, bool whole) {
    history_part_t part;
    omni_real_t theta = state->pose.theta; /* heading at the end of the slot */
    omni_real_t later[OMNI_AXES] = {0.0f, 0.0f, 0.0f};
    memset(window->move, 0, sizeof window->move);
    memset(window->jacobian, 0, sizeof window->jacobian);
    memset(u->w, 0, sizeof u->w);
    u->span_us = 0;
    begin_history_parts(&part, flow, whole);
    while (next_history_part(state, &part)) {
        const omni_ekf_slot_t *slot = &state->history[part.index];
        slot_motion_t motion = {{0.0f}, {{0.0f}}};
        find_slot_motion(state, slot, u->error_states, theta, 1.0f, &motion);
        theta -= motion.move[2];
        u->span_us += part.used_us;
        for (int axis = 0; axis < OMNI_AXES; ++axis) {
            later[axis] += part.skipped * motion.move[axis];
            motion.move[axis] *= part.used;
            for (uint8_t i = 0; i < u->error_states; ++i) {
                motion.jacobian[axis][i] *= part.used;
            }
        }
        propagate_jacobian(window, window->move, &motion, u->error_states, 1.0f);
        for (int axis = 0; axis < OMNI_AXES; ++axis) {
            window->move[axis] += motion.move[axis];
        }
        u->w[0] += config->q_xy * slot->steps * part.used;
        u->w[2] += (config->has_gyro ? slot->turn_noise : config->q_theta * slot->steps) * part.used;
    }
    u->w[1] = u->w[0];
    u->theta = state->pose.theta - later[2] - 0.5f * window->move[2];
    u->since[0] = later[0] + 0.5f * window->move[0];
    u->since[1] = later[1] + 0.5f * window->move[1];
    return part.left_us == 0;
}

/* Rotate to the body axes at mid-interval. An error of the turn rotates these axes by half of it. */
static void rotate_to_body_axes(flow_update_t *u, const omni_ekf_window_t *window) {
    omni_sincosf(u->theta, &u->sine, &u->cosine);
    memcpy(u->move, window->move, sizeof u->move);
    rotate_pair(u->cosine, -u->sine, &u->move[0], &u->move[1]);
    for (uint8_t i = 0; i < u->error_states; ++i) {
        const omni_real_t turned = window->jacobian[2][i];
        omni_real_t gx = window->jacobian[0][i];
        omni_real_t gy = window->jacobian[1][i];
        rotate_pair(u->cosine, -u->sine, &gx, &gy);
        u->jacobian[0][i] = gx + 0.5f * u->move[1] * turned;
        u->jacobian[1][i] = gy - 0.5f * u->move[0] * turned;
        u->jacobian[2][i] = turned;
    }
}

/* Variances by encoder quantisation at both ends of the interval, in body axes (0 for a gyro's turn), and of the
 * reading. */
static void find_noise(flow_update_t *u, const omni_pose_ekf_config_t *config, const omni_kinematics_t *k,
                       const omni_ekf_flow_t *flow) {
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        u->c[axis] = 0.0f;
        for (uint8_t i = 0; i < k->wheels; ++i) {
            u->c[axis] += k->b_pinv[axis][i] * k->b_pinv[axis][i] * config->r_count;
        }
        u->r[axis] = axis < 2 ? flow->r_xy : flow->r_turn;
    }
    if (config->has_gyro) {
        u->c[2] = 0.0f;
    }
}

/* Measured minus predicted displacement of the sensor. */
static void find_innovation(flow_update_t *u, const omni_pose_ekf_state_t *state, const omni_ekf_flow_t *flow,
                            omni_ekf_flow_result_t *result) {
    const omni_real_t x = u->move[0] - flow->lever_arm_m[1] * u->move[2];
    const omni_real_t y = u->move[1] + flow->lever_arm_m[0] * u->move[2];
    u->innovation[0] = flow->move[0] - x;
    u->innovation[1] = flow->move[1] - y;
    u->innovation[2] = flow->move[2] - u->move[2];
    result->predicted_m = omni_sqrtf(x * x + y * y);
    result->residual_variance_m2 = u->w[0] + u->c[0] + u->r[0];
    result->residual_m = omni_sqrtf(u->innovation[0] * u->innovation[0] + u->innovation[1] * u->innovation[1]);
    const omni_real_t turn = u->rows > 2 ? u->innovation[2] : 0.0f;
    const omni_real_t more[OMNI_AXES] = {u->innovation[0] + flow->lever_arm_m[1] * turn,
                                         u->innovation[1] - flow->lever_arm_m[0] * turn, turn};
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        result->predicted[axis] = u->move[axis];
        result->measured[axis] = u->move[axis] + more[axis];
        result->no_slip[axis] = u->move[axis];
        for (uint8_t i = 0; i < u->error_states && i < OMNI_MAX_WHEELS; ++i) {
            result->no_slip[axis] -= u->jacobian[axis][i] * state->error_state[i];
        }
    }
}

static void find_sensitivity(flow_update_t *u, const omni_ekf_flow_t *flow) {
    for (uint8_t i = 0; i < u->error_states; ++i) {
        u->h[0][i] = u->jacobian[0][i] - flow->lever_arm_m[1] * u->jacobian[2][i];
        u->h[1][i] = u->jacobian[1][i] + flow->lever_arm_m[0] * u->jacobian[2][i];
        u->h[2][i] = u->jacobian[2][i];
    }
}

/* Covariance of state and innovation: by the slip ratios, and by the motion's noise, which is in both. */
static void compute_cross_covariance(flow_update_t *u, const omni_pose_ekf_state_t *state, const omni_real_t *lever,
                                     bool noise_is_shared) {
    for (uint8_t row = 0; row < u->rows; ++row) {
        for (uint8_t a = 0; a < u->states; ++a) {
            omni_real_t sum = 0.0f;
            for (uint8_t i = 0; i < u->error_states; ++i) {
                sum += state->p[a][OMNI_AXES + i] * u->h[row][i];
            }
            u->cross[row][a] = sum;
        }
    }
    if (noise_is_shared) {
        u->cross[0][0] += u->w[0] * u->cosine;
        u->cross[0][1] += u->w[0] * u->sine;
        u->cross[1][0] -= u->w[0] * u->sine;
        u->cross[1][1] += u->w[0] * u->cosine;
        for (uint8_t row = 0; row < u->rows; ++row) {
            const omni_real_t turned = u->w[2] * lever[row];
            u->cross[row][0] -= u->since[1] * turned;
            u->cross[row][1] += u->since[0] * turned;
            u->cross[row][2] += turned;
        }
    }
}

/* S = H P H^T + W + C + R = L L^T. */
static void factor_flow_covariance(flow_update_t *u, const omni_pose_ekf_state_t *state, const omni_real_t *lever) {
    for (uint8_t i = 0; i < u->rows; ++i) {
        for (uint8_t j = 0; j <= i; ++j) {
            omni_real_t sum = lever[i] * lever[j] * (u->w[2] + u->c[2]);
            if (i == j) {
                sum += u->r[i] + (i < 2 ? u->w[i] + u->c[i] : 0.0f);
            }
            for (uint8_t m = 0; m < u->error_states; ++m) {
                for (uint8_t n = 0; n < u->error_states; ++n) {
                    sum += u->h[i][m] * state->p[OMNI_AXES + m][OMNI_AXES + n] * u->h[j][n];
                }
            }
            for (uint8_t c = 0; c < j; ++c) {
                sum -= u->factor[i][c] * u->factor[j][c];
            }
            u->factor[i][j] = i == j ? omni_sqrtf(sum) : sum / u->factor[j][j];
        }
    }
}

static void whiten_flow(const flow_update_t *u, omni_real_t *v, ptrdiff_t stride) {
    for (int i = 0; i < u->rows; ++i) {
        for (int c = 0; c < i; ++c) {
            v[i * stride] -= u->factor[i][c] * v[c * stride];
        }
        v[i * stride] /= u->factor[i][i];
    }
}

/* Correct the motion in the history and reduce its noise, so that delayed fixes stay exact. */
static void update_history(const flow_update_t *u, omni_pose_ekf_state_t *state, const omni_ekf_flow_t *flow,
                           const omni_real_t *lever) {
    omni_real_t more[FLOW_ROWS] = {0.0f, 0.0f, 0.0f}; /* S^-1 y */
    for (int i = u->rows - 1; i >= 0; --i) {
        more[i] = u->white[i];
        for (int c = i + 1; c < u->rows; ++c) {
            more[i] -= u->factor[c][i] * more[c];
        }
        more[i] /= u->factor[i][i];
    }
    const omni_real_t noise = u->gyro ? 0.0f : u->w[2]; /* a gyro's turn is not corrected */
    const omni_real_t turn = noise * (lever[0] * more[0] + lever[1] * more[1] + lever[2] * more[2]);
    const omni_real_t known_xy = u->w[0] / (u->w[0] + u->c[0] + u->r[0]);
    const omni_real_t known_turn = u->rows > 2 ? u->w[2] / (u->w[2] + u->c[2] + u->r[2]) : 0.0f;
    history_part_t part;
    omni_real_t theta = state->pose.theta;
    begin_history_parts(&part, flow, false);
    while (next_history_part(state, &part)) {
        omni_ekf_slot_t *slot = &state->history[part.index];
        const omni_real_t of_span = (omni_real_t)part.used_us / (omni_real_t)flow->span_us;
        theta -= slot->move[2];
        omni_real_t sine;
        omni_real_t cosine;
        omni_sincosf(u->theta - theta, &sine, &cosine);
        omni_real_t x = u->w[0] * more[0] * of_span;
        omni_real_t y = u->w[1] * more[1] * of_span;
        rotate_pair(cosine, sine, &x, &y);
        slot->move[0] += x;
        slot->move[1] += y;
        slot->move[2] += turn * of_span;
        omni_real_t *known = state->flow_noise_removed[part.index];
        known[0] = omni_clampf(known[0] + known_xy * part.used, 0.0f, 1.0f);
        known[1] = omni_clampf(known[1] + known_turn * part.used, 0.0f, 1.0f);
    }
    memcpy(state->last_propagated_slot.move, state->history[state->open_slot].move,
           sizeof state->last_propagated_slot.move);
}

/* Is it a state that the gyro determines: heading, bias, scale? Lasting slip would bias these. */
static bool is_gyro_state(const omni_pose_ekf_config_t *config, uint8_t a) {
    return config->has_gyro && (a == 2 || a >= (uint8_t)(OMNI_AXES + (int)OMNI_EKF_GYRO_BIAS));
}

/* x += K y and P -= K S K^T, with K = cross S^-1. The gyro's states are consider states (Schmidt-Kalman filter): not
 * corrected, but their covariance is used. */
static void apply_flow_correction(const flow_update_t *u, omni_pose_ekf_state_t *state,
                                  const omni_pose_ekf_config_t *config) {
    omni_real_t delta[OMNI_EKF_STATES] = {0.0f};
    for (uint8_t a = 0; a < u->states; ++a) {
        for (uint8_t row = 0; row < u->rows && !is_gyro_state(config, a); ++row) {
            delta[a] += u->cross[row][a] * u->white[row];
        }
    }
    for (uint8_t a = 0; a < u->states; ++a) {
        for (uint8_t b = a; b < u->states; ++b) {
            const bool both = is_gyro_state(config, a) && is_gyro_state(config, b);
            for (uint8_t row = 0; row < u->rows && !both; ++row) {
                state->p[a][b] -= u->cross[row][a] * u->cross[row][b];
            }
            state->p[b][a] = state->p[a][b];
        }
    }
    omni_ekf_apply_correction(state, delta, u->error_states);
}

/* pose -= jacobian slip, in the covariance: the pose no longer depends on the slip during the interval. */
static void remove_slip_dependence(const flow_update_t *u, omni_pose_ekf_state_t *state,
                                   omni_real_t gain[OMNI_AXES][OMNI_MAX_WHEELS]) {
    omni_real_t(*p)[OMNI_EKF_STATES] = state->p;
    for (int a = 0; a < OMNI_AXES; ++a) {
        for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
            for (uint8_t b = 0; b < u->states; ++b) {
                p[a][b] -= gain[a][i] * p[OMNI_AXES + i][b];
            }
        }
    }
    for (int a = 0; a < OMNI_AXES; ++a) {
        for (int b = a; b < OMNI_AXES; ++b) {
            for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
                p[a][b] -= p[a][OMNI_AXES + i] * gain[b][i];
            }
        }
        for (uint8_t b = (uint8_t)a; b < u->states; ++b) {
            p[b][a] = p[a][b];
        }
    }
}

/* Replace the motion of the interval's slots by the reading's; remove its dependence on slip. */
static void override_history(const flow_update_t *u, omni_pose_ekf_state_t *state, const omni_ekf_flow_t *flow,
                             const omni_real_t *more) {
    history_part_t part;
    omni_real_t theta = state->pose.theta;
    begin_history_parts(&part, flow, true);
    while (next_history_part(state, &part)) {
        omni_ekf_slot_t *slot = &state->history[part.index];
        const omni_real_t of_span = (omni_real_t)part.used_us / (omni_real_t)(u->span_us > 0 ? u->span_us : 1u);
        theta -= slot->move[2];
        omni_real_t sine;
        omni_real_t cosine;
        omni_sincosf(u->theta - theta, &sine, &cosine);
        omni_real_t change[OMNI_AXES] = {more[0] * of_span, more[1] * of_span, more[2] * of_span};
        rotate_pair(cosine, sine, &change[0], &change[1]);
        for (int axis = 0; axis < OMNI_AXES; ++axis) {
            slot->move[axis] += change[axis];
            const omni_real_t kept = axis < u->rows ? 1.0f - part.used : 1.0f;
            for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
                slot->jacobian[axis][i] *= kept;
            }
        }
    }
}

/* Wheels spin or slide: replace their motion by the reading's. If the turn is not measured, its standard deviation is
 * the residual over the lever arm. */
static void override_motion(const flow_update_t *u, omni_pose_ekf_state_t *state, const omni_kinematics_t *k,
                            const omni_ekf_flow_t *flow, const omni_ekf_window_t *window,
                            const omni_ekf_flow_result_t *result) {
    const omni_real_t turned = u->rows > 2 ? u->innovation[2] : 0.0f;
    const omni_real_t later[2] = {u->since[0] - 0.5f * window->move[0], u->since[1] - 0.5f * window->move[1]};
    omni_real_t more[OMNI_AXES] = {result->measured[0] - u->move[0], result->measured[1] - u->move[1], turned};
    omni_real_t gain[OMNI_AXES][OMNI_MAX_WHEELS] = {{0.0f}};
    for (uint8_t i = 0; i < u->error_states && i < OMNI_MAX_WHEELS; ++i) {
        const omni_real_t turn = window->jacobian[2][i];
        gain[0][i] = window->jacobian[0][i] - later[1] * turn;
        gain[1][i] = window->jacobian[1][i] + later[0] * turn;
        gain[2][i] = u->rows > 2 ? turn : 0.0f;
    }
    remove_slip_dependence(u, state, gain);
    /* An unmeasured turn keeps its sign for many readings: deviations add up, not variances. */
    const bool by_gyro = u->gyro && window->jacobian[2][OMNI_EKF_GYRO_BIAS] != 0.0f;
    const omni_real_t unseen = by_gyro ? 0.0f : result->residual_m / omni_absf(omni_lever_arm_m(k));
    const omni_real_t unseen_noise = unseen * (unseen + 2.0f * omni_sqrtf(state->p[2][2]));
    const omni_real_t arm2 = flow->lever_arm_m[0] * flow->lever_arm_m[0] + flow->lever_arm_m[1] * flow->lever_arm_m[1];
    const omni_real_t turn_noise = u->rows > 2 ? u->r[2] : unseen_noise;
    const omni_real_t xy = u->r[0] + arm2 * turn_noise;
    const omni_real_t lever[OMNI_AXES] = {-u->since[1], u->since[0], 1.0f};
    for (int a = 0; a < OMNI_AXES; ++a) {
        for (int b = 0; b < OMNI_AXES; ++b) {
            state->p[a][b] += turn_noise * lever[a] * lever[b] + (a == b && a < 2 ? xy : 0.0f);
        }
    }
    override_history(u, state, flow, more);
    omni_real_t sine;
    omni_real_t cosine;
    omni_sincosf(u->theta + 0.5f * turned, &sine, &cosine);
    omni_real_t x = result->measured[0];
    omni_real_t y = result->measured[1];
    rotate_pair(cosine, sine, &x, &y);
    omni_real_t delta[OMNI_EKF_STATES] = {0.0f};
    delta[0] = x - window->move[0] - later[1] * turned;
    delta[1] = y - window->move[1] + later[0] * turned;
    delta[2] = turned;
    omni_ekf_apply_correction(state, delta, u->error_states);
}

bool omni_pose_ekf_correct_flow(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                const omni_kinematics_t *k, const omni_ekf_flow_t *flow,
                                omni_ekf_flow_result_t *result) {
    flow_update_t u;
    omni_ekf_window_t window;
    memset(&u, 0, sizeof u);
    u.gyro = config->has_gyro;
    u.rows = flow->measures_turn && !config->has_gyro ? 3 : 2;
    u.error_states = omni_ekf_error_states(config, k);
    u.states = (uint8_t)(OMNI_AXES + u.error_states);
    omni_pose_ekf_propagate_covariance(state, config, k);
    if (config->has_gyro) {
        omni_ekf_add_pending_gyro_noise(state);
    }
    if (state->time_us <= (uint64_t)flow->age_us + flow->span_us ||
        !integrate_history_motion(&u, state, config, flow, &window, false)) {
        return false;
    }
    const omni_real_t lever[FLOW_ROWS] = {-flow->lever_arm_m[1], flow->lever_arm_m[0], 1.0f};
    const bool shared = state->last_fix_taken_us <= state->time_us - flow->age_us - flow->span_us;
    rotate_to_body_axes(&u, &window);
    find_noise(&u, config, k, flow);
    find_innovation(&u, state, flow, result);
    find_sensitivity(&u, flow);
    factor_flow_covariance(&u, state, lever);
    compute_cross_covariance(&u, state, lever, shared);
    memcpy(u.white, u.innovation, sizeof u.white);
    whiten_flow(&u, u.white, 1);
    for (uint8_t a = 0; a < u.states; ++a) {
        whiten_flow(&u, &u.cross[0][a], OMNI_EKF_STATES);
    }
    const omni_real_t nis =
        u.white[0] * u.white[0] + u.white[1] * u.white[1] + (u.rows > 2 ? u.white[2] * u.white[2] : 0.0f);
    const bool known = nis < largest_nis; /* false for NaN: the covariance is singular by rounding */
    result->nis = known ? nis : largest_nis;
    const omni_real_t turned_m = u.move[2] * omni_lever_arm_m(k);
    const bool moves = result->predicted_m * result->predicted_m + turned_m * turned_m > 16.0f * flow->r_xy;
    const bool may_override = flow->apply && flow->override_nis > 0.0f && moves && shared;
    result->overrode_wheels = known && may_override && nis > flow->override_nis;
    result->within_gate = known && !result->overrode_wheels && (config->flow_gate == 0.0f || nis <= config->flow_gate);
    if (result->overrode_wheels) {
        omni_ekf_flow_result_t whole = *result;
        (void)integrate_history_motion(&u, state, config, flow, &window, true);
        rotate_to_body_axes(&u, &window);
        find_innovation(&u, state, flow, &whole);
        override_motion(&u, state, k, flow, &window, &whole);
        state->flow_slots = OMNI_EKF_HISTORY;
    } else if (flow->apply && result->within_gate) {
        if (shared) {
            update_history(&u, state, flow, lever);
        }
        apply_flow_correction(&u, state, config);
        state->flow_slots = OMNI_EKF_HISTORY;
    }
    return true;
}
