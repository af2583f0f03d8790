/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "../math/math_inline.h"
#include "../model/kinematics_inline.h"
#include "pose_ekf_internal.h"

enum { FUTURE_US = 5000 };

/* Minimum variance of a fix (1 um, 1 urad): keeps the innovation covariance invertible. */
static const omni_real_t min_variance = 1e-12f;

/* Quantiles of a chi-square with three degrees of freedom. */
static const omni_real_t chi2_999 = 16.27f; /* 99.9 % */
static const omni_real_t chi2_95 = 7.81f;   /* 95 % */

/* |dx| + |dy| + |dtheta| per history slot above which the robot counts as moving: 10 mm/s, or 10 mrad/s. */
static const omni_real_t moving_threshold = 4e-5f;

typedef omni_real_t state_matrix_t[OMNI_EKF_STATES][OMNI_EKF_STATES];
typedef omni_real_t wide_matrix_t[OMNI_AXES][OMNI_EKF_STATES];

/* Correction by one fix. H = Phi_pose^-1 [I, -Phi_ps] = [1, 0, dy; 0, 1, -dx; 0, 0, 1 | slips]: of it
 * only `slip_states` is stored. */
typedef struct update_t {
    uint8_t error_states;
    uint32_t age_us;
    omni_ekf_window_t window;
    omni_real_t r[OMNI_AXES]; /* variances of the fix */
    omni_real_t innovation[OMNI_AXES];
    omni_real_t slip_states[OMNI_AXES][OMNI_EKF_ERROR_STATES];
    state_matrix_t m;                         /* M = P - W */
    wide_matrix_t hm;                         /* H M */
    omni_real_t factor[OMNI_AXES][OMNI_AXES]; /* S = L D L^T: of L what is below its diagonal of ones */
    omni_real_t inverse[OMNI_AXES];           /* D^-1 */
    omni_real_t white[OMNI_AXES];             /* L^-1 innovation, with the variances D */
} update_t;

static inline void measurement_matrix(update_t *u, uint8_t error_states) {
    const omni_real_t dx = u->window.move[0];
    const omni_real_t dy = u->window.move[1];
    for (uint8_t i = 0; i < error_states; ++i) {
        const omni_real_t turned = u->window.jacobian[2][i];
        u->slip_states[0][i] = -u->window.jacobian[0][i] - dy * turned;
        u->slip_states[1][i] = -u->window.jacobian[1][i] + dx * turned;
        u->slip_states[2][i] = -turned;
    }
}

/* Row i of H times a vector with an entry per state. */
static inline omni_real_t row_of_h(const update_t *u, int i, const omni_real_t *v, uint8_t error_states) {
    omni_real_t sum = v[i];
    if (i < 2) {
        sum += (i == 0 ? u->window.move[1] : -u->window.move[0]) * v[2];
    }
    for (uint8_t c = 0; c < error_states; ++c) {
        sum += u->slip_states[i][c] * v[OMNI_AXES + c];
    }
    return sum;
}

/* M, and H M: as M is symmetric, a row of it is a column. */
static inline void fill_m(update_t *u, const omni_pose_ekf_state_t *state, uint8_t error_states) {
    const int states = OMNI_AXES + error_states;
    for (int a = 0; a < states; ++a) {
        for (int b = a; b < states; ++b) {
            u->m[a][b] = state->p[a][b] - u->window.noise[a][b];
            u->m[b][a] = u->m[a][b];
        }
    }
    for (int b = 0; b < states; ++b) {
        for (int row = 0; row < OMNI_AXES; ++row) {
            u->hm[row][b] = row_of_h(u, row, u->m[b], error_states);
        }
    }
}

/* S = H M H^T + R = L D L^T: no square roots. @return false if S is not positive definite. */
static inline bool factor_innovation_covariance(update_t *u, uint8_t error_states) {
    for (int i = 0; i < OMNI_AXES; ++i) {
        omni_real_t scaled[OMNI_AXES]; /* row i of L D */
        for (int j = 0; j <= i; ++j) {
            scaled[j] = row_of_h(u, j, u->hm[i], error_states);
            for (int c = 0; c < j; ++c) {
                scaled[j] -= scaled[c] * u->factor[j][c];
            }
            if (j < i) {
                u->factor[i][j] = scaled[j] * u->inverse[j];
            }
        }
        scaled[i] += u->r[i];
        if (!(scaled[i] > 0.0f)) {
            return false;
        }
        u->inverse[i] = 1.0f / scaled[i];
    }
    return true;
}

/* v = L^-1 v. */
static inline void forward_substitute(const update_t *u, omni_real_t *v) {
    v[1] -= u->factor[1][0] * v[0];
    v[2] -= u->factor[2][0] * v[0] + u->factor[2][1] * v[1];
}

static omni_real_t normalised_square(update_t *u) {
    omni_real_t *v = u->white;
    memcpy(v, u->innovation, sizeof u->white);
    forward_substitute(u, v);
    return v[0] * v[0] * u->inverse[0] + v[1] * v[1] * u->inverse[1] + v[2] * v[2] * u->inverse[2];
}

/*
 * Adapt the noise factors from the innovations: see omni/pose_ekf.h. A robot at rest does not excite the wheels' noise:
 * the factors are held then. The last complete slot of the history decides.
 */
static inline void adapt_noise(const update_t *u, omni_pose_ekf_state_t *state, omni_real_t adapt, omni_real_t nis) {
    const omni_real_t *moved = state->history[(state->open_slot + OMNI_EKF_HISTORY - 1) % OMNI_EKF_HISTORY].move;
    const omni_flag_t moves = omni_absf(moved[0]) + omni_absf(moved[1]) + omni_absf(moved[2]) > moving_threshold;
    omni_real_t slope = 0.0f;
    for (int i = 0; i < OMNI_AXES; ++i) {
        const omni_real_t white = u->white[i] * omni_sqrtf(u->inverse[i]);
        const omni_real_t share = u->r[i] * u->inverse[i];
        const omni_real_t kept = omni_minf(share, 1.0f); /* more only by rounding */
        slope += (1.0f - kept) * white * state->whitened_innovation_sum[i];
        state->whitened_innovation_sum[i] =
            omni_select(moves, kept * state->whitened_innovation_sum[i] + white, state->whitened_innovation_sum[i]);
    }
    const omni_real_t rate = omni_select(moves, adapt, 0.0f);
    const omni_real_t change = omni_clampf(rate * slope, -OMNI_EKF_MAX_ADAPT_STEP, OMNI_EKF_MAX_ADAPT_STEP);
    const omni_real_t square = omni_minf(nis, 12.0f) / 3.0f - (1.0f + OMNI_EKF_FIX_NOISE_MARGIN);
    const omni_real_t noise = state->noise_factor * (1.0f + change);
    const omni_real_t fix = state->fix_noise_factor * (1.0f + 0.05f * rate * square);
    state->noise_factor = omni_clampf(noise, OMNI_EKF_MIN_NOISE_FACTOR, OMNI_EKF_MAX_NOISE_FACTOR);
    const omni_flag_t bounded = state->noise_factor < OMNI_EKF_MAX_SLIP_NOISE_FACTOR;
    state->slip_noise_factor = omni_select(bounded, state->noise_factor, OMNI_EKF_MAX_SLIP_NOISE_FACTOR);
    state->fix_noise_factor = omni_clampf(fix, 1.0f, OMNI_EKF_MAX_FIX_NOISE_FACTOR);
}

/* Row a of K = (H M)^T S^-1 (eq. 65). */
static inline void gain_row(const update_t *u, int a, omni_real_t *row) {
    for (int i = 0; i < OMNI_AXES; ++i) {
        row[i] = u->hm[i][a];
    }
    forward_substitute(u, row);
    row[2] *= u->inverse[2];
    row[1] = row[1] * u->inverse[1] - u->factor[2][1] * row[2];
    row[0] = row[0] * u->inverse[0] - u->factor[1][0] * row[1] - u->factor[2][0] * row[2];
}

/* (I - K H) M for one row a, given row a of K. */
static inline void updated_row(const update_t *u, int a, const omni_real_t *gain, omni_real_t *row, int states) {
    for (int b = 0; b < states; ++b) {
        row[b] = u->m[a][b] - gain[0] * u->hm[0][b] - gain[1] * u->hm[1][b] - gain[2] * u->hm[2][b];
    }
}

/* Joseph form of eq. 67: P = (I - K H) M (I - K H)^T + K R K^T + W. */
static inline void measurement_update_columns(const update_t *u, omni_pose_ekf_state_t *state, uint8_t error_states) {
    const int states = OMNI_AXES + error_states;
    omni_real_t gain[OMNI_EKF_STATES][OMNI_AXES];
    omni_real_t delta[OMNI_EKF_STATES];
    for (int a = 0; a < states; ++a) {
        gain_row(u, a, gain[a]);
        delta[a] = gain[a][0] * u->innovation[0] + gain[a][1] * u->innovation[1] + gain[a][2] * u->innovation[2];
    }
    for (int a = 0; a < states; ++a) {
        omni_real_t row[OMNI_EKF_STATES];
        omni_real_t left[OMNI_AXES];
        updated_row(u, a, gain[a], row, states);
        for (int i = 0; i < OMNI_AXES; ++i) {
            left[i] = gain[a][i] * u->r[i] - row_of_h(u, i, row, error_states);
        }
        for (int b = a; b < states; ++b) {
            state->p[a][b] =
                row[b] + left[0] * gain[b][0] + left[1] * gain[b][1] + left[2] * gain[b][2] + u->window.noise[a][b];
            state->p[b][a] = state->p[a][b];
        }
    }
    omni_ekf_apply_correction(state, delta, u->error_states);
}

/* The count as a constant lets the compiler unroll the loops; three wheels and no slip are the ones to be fast. */
static void measurement_update(const update_t *u, omni_pose_ekf_state_t *state) {
    if (u->error_states == 3) {
        measurement_update_columns(u, state, 3);
    } else if (u->error_states == 0) {
        measurement_update_columns(u, state, 0);
    } else {
        measurement_update_columns(u, state, u->error_states);
    }
}

static inline bool factor_innovation_covariance_columns(update_t *u, const omni_pose_ekf_state_t *state,
                                                        uint8_t error_states) {
    measurement_matrix(u, error_states);
    fill_m(u, state, error_states);
    return factor_innovation_covariance(u, error_states);
}

/* As in `measurement_update`. @return false if the innovation's covariance is not positive definite. */
static bool innovation_covariance(update_t *u, const omni_pose_ekf_state_t *state) {
    if (u->error_states == 3) {
        return factor_innovation_covariance_columns(u, state, 3);
    }
    return u->error_states == 0 ? factor_innovation_covariance_columns(u, state, 0)
                                : factor_innovation_covariance_columns(u, state, u->error_states);
}

/* Variance of x and of y from slip ratios with variance `ratio` over a distance of the wheels. */
static inline omni_real_t slip_variance(omni_real_t ratio, omni_real_t distance_m) {
    return ratio * distance_m * distance_m;
}

/* The variance of theta that goes with it. */
static inline omni_real_t slip_turn_variance(const omni_kinematics_t *k, omni_real_t variance) {
    return variance / (omni_lever_arm_m(k) * omni_lever_arm_m(k) * (omni_real_t)k->wheels);
}

/*
 * Gate an unlikely fix once more, with the covariance inflated for slip since the last used fix. If the fix is likely
 * then, `p` stays inflated.
 * @return the NIS for the gate; `u` up to the factors of S belongs to the resulting `p`.
 */
static omni_real_t inflate_for_slip(update_t *u, const omni_pose_ekf_config_t *config, const omni_kinematics_t *k,
                                    omni_pose_ekf_state_t *state, omni_real_t nis) {
    const omni_flag_t unlikely = nis > chi2_999;
    omni_real_t ratio = config->p_slip; /* and a third of the estimated ratio */
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        ratio += state->error_state[i] * state->error_state[i] * (1.0f / 9.0f);
    }
    const omni_real_t slipped = slip_variance(ratio, state->distance_since_fix_m);
    const omni_flag_t explains = unlikely && slipped > u->r[0];
    const omni_real_t variance = omni_select(explains, slipped, 0.0f);
    const omni_real_t before[OMNI_AXES] = {state->p[0][0], state->p[1][1], state->p[2][2]};
    state->p[0][0] += variance;
    state->p[1][1] += variance;
    state->p[2][2] += slip_turn_variance(k, variance);
    const omni_real_t inflated = innovation_covariance(u, state) ? normalised_square(u) : nis;
    const omni_flag_t fits = inflated <= chi2_999;
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        state->p[axis][axis] = omni_select(fits, state->p[axis][axis], before[axis]);
    }
    if (omni_all(fits)) {
        return inflated;
    }
    return innovation_covariance(u, state) ? normalised_square(u) : nis;
}

static void set_innovation(update_t *u, const omni_pose_ekf_state_t *state, const omni_pose_fix_t *fix) {
    const omni_real_t *move = u->window.move;
    u->innovation[0] = (fix->pose.x - state->pose.x) + (move[0] - state->kahan_compensation[0]);
    u->innovation[1] = (fix->pose.y - state->pose.y) + (move[1] - state->kahan_compensation[1]);
    u->innovation[2] = omni_wrap_pi((fix->pose.theta - state->pose.theta) + (move[2] - state->kahan_compensation[2]));
}

/* Set the pose at the time of the fix to the fix; the motion since then is rotated with it. */
static void move_to_fix(const update_t *u, omni_pose_ekf_state_t *state) {
    omni_real_t sine;
    omni_real_t cosine;
    omni_sincosf(u->innovation[2], &sine, &cosine);
    const omni_real_t dx = u->window.move[0];
    const omni_real_t dy = u->window.move[1];
    const omni_real_t delta[OMNI_EKF_STATES] = {u->innovation[0] + (cosine - 1.0f) * dx - sine * dy,
                                                u->innovation[1] + sine * dx + (cosine - 1.0f) * dy, u->innovation[2]};
    omni_ekf_apply_correction(state, delta, u->error_states);
}

/* Restart from a fix after too many consistent refused ones: pose by the fix propagated to now, slip ratios 0. */
static void reinitialise_filter(update_t *u, const omni_pose_ekf_config_t *config, const omni_kinematics_t *k,
                                const omni_pose_fix_t *fix, omni_pose_ekf_state_t *state) {
    omni_ekf_restart_slips(state, config, omni_ekf_slips(config, k));
    omni_ekf_history_rebase(state, u->error_states);
    (void)omni_ekf_history_window(state, config, k, u->age_us, &u->window);
    set_innovation(u, state, fix);
    const omni_flag_t has_heading = u->r[2] < OMNI_EKF_UNKNOWN_HEADING_VARIANCE;
    u->innovation[2] = omni_select(has_heading, u->innovation[2], 0.0f);
    u->r[2] = omni_select(has_heading, u->r[2], OMNI_EKF_UNKNOWN_HEADING_VARIANCE);
    move_to_fix(u, state);
    (void)omni_ekf_history_window(state, config, k, u->age_us, &u->window);
    const omni_real_t phi[OMNI_AXES][OMNI_AXES] = {
        {1.0f, 0.0f, -u->window.move[1]}, {0.0f, 1.0f, u->window.move[0]}, {0.0f, 0.0f, 1.0f}};
    for (int a = 0; a < OMNI_AXES; ++a) {
        for (int b = 0; b < OMNI_AXES; ++b) {
            state->p[a][b] = a < b ? u->window.noise[a][b] : u->window.noise[b][a];
            for (int i = 0; i < OMNI_AXES; ++i) {
                state->p[a][b] += phi[a][i] * u->r[i] * phi[b][i];
            }
        }
    }
    omni_ekf_restart_noise(state);
    ++state->restarts;
}

static omni_pose_t estimate_at(const update_t *u, const omni_pose_fix_t *fix) {
    const omni_pose_t pose = {fix->pose.x - u->innovation[0], fix->pose.y - u->innovation[1],
                              fix->pose.theta - u->innovation[2]};
    return pose;
}

/* Motion between two poses in the axes of the first: x, y [m], turn [rad]. */
static void motion_between(const omni_pose_t *from, const omni_pose_t *to, omni_real_t *motion) {
    omni_real_t sine;
    omni_real_t cosine;
    omni_sincosf(from->theta, &sine, &cosine);
    const omni_real_t dx = to->x - from->x;
    const omni_real_t dy = to->y - from->y;
    motion[0] = cosine * dx + sine * dy;
    motion[1] = cosine * dy - sine * dx;
    motion[2] = omni_wrap_pi(to->theta - from->theta);
}

/* Is a refused fix consistent with the first of its row: has it moved as the wheels have? */
static bool is_consistent_with_first(const update_t *u, const omni_pose_ekf_state_t *state,
                                     const omni_pose_ekf_config_t *config, const omni_kinematics_t *k,
                                     const omni_pose_fix_t *fix) {
    const omni_pose_t estimate = estimate_at(u, fix);
    const omni_real_t slip =
        slip_variance(config->p_slip, state->distance_since_fix_m - state->first_refused_distance_m);
    const omni_real_t turn_variance = 2.0f * u->r[2] + slip_turn_variance(k, slip);
    omni_real_t fixes[OMNI_AXES];
    omni_real_t wheels[OMNI_AXES];
    motion_between(&state->first_refused_fix, &fix->pose, fixes);
    motion_between(&state->first_refused_estimate, &estimate, wheels);
    const omni_real_t square = wheels[0] * wheels[0] + wheels[1] * wheels[1];
    if (!(turn_variance < OMNI_EKF_UNKNOWN_HEADING_VARIANCE)) {
        const omni_real_t longer = omni_sqrtf(fixes[0] * fixes[0] + fixes[1] * fixes[1]) - omni_sqrtf(square);
        return longer * longer <= chi2_95 * (2.0f * u->r[0] + slip);
    }
    const omni_real_t variance =
        2.0f * u->r[0] + slip + u->r[2] * square; /* the error of the first fix's heading rotates the motion */
    const omni_real_t ex = fixes[0] - wheels[0];
    const omni_real_t ey = fixes[1] - wheels[1];
    const omni_real_t turn = omni_wrap_pi(fixes[2] - wheels[2]);
    return (ex * ex + ey * ey) / variance + turn * turn / turn_variance <= chi2_95;
}

/* Count a fix that the gate refused. @return true: enough consistent ones to restart the estimate. */
static bool count_refused(const update_t *u, omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                          const omni_kinematics_t *k, const omni_pose_fix_t *fix) {
    ++state->consecutive_refusals;
    if (state->consecutive_refusals == 1 || !is_consistent_with_first(u, state, config, k, fix)) {
        state->consecutive_refusals = 1;
        state->first_refused_fix = fix->pose;
        state->first_refused_estimate = estimate_at(u, fix);
        state->first_refused_distance_m = state->distance_since_fix_m;
    }
    const bool rolled = state->distance_since_fix_m - state->first_refused_distance_m > OMNI_EKF_RESTART_DISTANCE_M;
    const bool is_dead_reckoning = rolled && omni_ekf_is_dead_reckoning(state->last_absolute_update_us, state->time_us);
    return state->consecutive_refusals >= config->gate_restart ||
           (is_dead_reckoning && state->consecutive_refusals >= OMNI_EKF_RESTART_FIXES);
}

static omni_real_t variance_of(omni_real_t sd, omni_real_t configured) {
    const omni_real_t variance = sd > 0.0f ? sd * sd : configured;
    return omni_maxf(variance, min_variance);
}

/* Fill everything up to the factors of S. */
static omni_result_t prepare_update(update_t *u, const omni_pose_ekf_state_t *state,
                                    const omni_pose_ekf_config_t *config, const omni_kinematics_t *k,
                                    const omni_pose_fix_t *fix) {
    u->error_states = omni_ekf_error_states(config, k);
    u->r[0] = variance_of(fix->sd_xy, config->r_xy) * state->fix_noise_factor;
    u->r[1] = u->r[0];
    u->r[2] = variance_of(fix->sd_theta, config->r_theta) * state->fix_noise_factor;
    if (!omni_ekf_history_window(state, config, k, u->age_us, &u->window)) {
        return OMNI_ERR_TIME;
    }
    set_innovation(u, state, fix);
    return innovation_covariance(u, state) ? OMNI_OK : OMNI_ERR_RANGE;
}

/* Age of the fix, or OMNI_ERR_TIME if it cannot be used. */
static omni_result_t age_of(const omni_pose_ekf_state_t *state, const omni_pose_fix_t *fix, uint32_t *age_us) {
    const uint64_t now = state->time_us; /* 0: no tick yet, nothing to compare with */
    const uint64_t taken = fix->time_us < now ? fix->time_us : now;
    if (now == 0 || fix->time_us > now + FUTURE_US || now - taken > UINT32_MAX ||
        (state->last_fix_taken_us != 0 && taken <= state->last_fix_taken_us)) {
        return OMNI_ERR_TIME;
    }
    *age_us = (uint32_t)(now - taken);
    return OMNI_OK;
}

static omni_result_t refuse_fix(omni_pose_ekf_state_t *state, omni_result_t why) {
    ++state->refused;
    return why;
}

omni_result_t omni_pose_ekf_correct(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                    const omni_kinematics_t *k, const omni_pose_fix_t *fix) {
    update_t u; /* Only the entries of the states in use are written and read. */
    if (config->mode == OMNI_EKF_MODE_ODOMETRY) {
        return OMNI_ERR_LOCKED;
    }
    omni_pose_ekf_propagate_covariance(state, config, k);
    if (config->has_gyro) {
        omni_ekf_add_pending_gyro_noise(state);
    }
    if (config->adapt_rate == 0.0f) {
        omni_ekf_restart_noise(state); /* the adaptation may just have been switched off */
    }
    if (!omni_pose_is_finite(&fix->pose) || !omni_is_finite(fix->sd_xy) || !omni_is_finite(fix->sd_theta)) {
        return refuse_fix(state, OMNI_ERR_NOT_FINITE);
    }
    omni_result_t result = age_of(state, fix, &u.age_us);
    if (result == OMNI_OK) {
        result = prepare_update(&u, state, config, k, fix);
    }
    /* Without a positive definite covariance every fix is refused by the gate, so that the estimate restarts. */
    const bool singular = result == OMNI_ERR_RANGE;
    if (result != OMNI_OK && !singular) {
        return refuse_fix(state, result);
    }
    omni_real_t nis = singular ? state->nis : normalised_square(&u);
    if (!omni_is_finite(nis)) {
        return refuse_fix(state, OMNI_ERR_NOT_FINITE); /* its square has overflowed */
    }
    if (!singular && config->gate > 0.0f && omni_any(nis > chi2_999) &&
        (state->consecutive_refusals == 0 || is_consistent_with_first(&u, state, config, k, fix))) {
        nis = inflate_for_slip(&u, config, k, state, nis);
    }
    memcpy(state->innovation, u.innovation, sizeof state->innovation);
    state->nis = nis;
    if (singular || (config->gate > 0.0f && !(state->nis <= config->gate))) {
        const bool restart =
            singular ? ++state->consecutive_refusals >= config->gate_restart : count_refused(&u, state, config, k, fix);
        if (!restart) {
            return refuse_fix(state, OMNI_ERR_RANGE);
        }
        if (singular && config->has_gyro) {
            omni_pose_ekf_start_gyro(state, config); /* its covariance may be the cause */
        }
        reinitialise_filter(&u, config, k, fix, state);
    } else {
        if (config->adapt_rate > 0.0f) {
            adapt_noise(&u, state, config->adapt_rate, nis);
        }
        measurement_update(&u, state);
    }
    ++state->accepted;
    state->consecutive_refusals = 0;
    state->last_fix_us = state->time_us;
    state->last_absolute_update_us = state->time_us;
    state->distance_since_fix_m = 0.0f;
    state->pose_noise_factor = state->noise_factor;
    state->last_fix_taken_us = state->time_us - u.age_us;
    return OMNI_OK;
}
