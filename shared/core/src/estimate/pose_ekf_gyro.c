/* SPDX-License-Identifier: MIT */
/* The difference between the gyro's and the wheels' turn measures slip ratios and the bias: see omni/pose_ekf.h. */
#include "pose_ekf_motion.h"
#include "pose_ekf_window.h"

enum { BIAS = OMNI_AXES + OMNI_EKF_GYRO_BIAS, SCALE = OMNI_AXES + OMNI_EKF_GYRO_SCALE };

/* Gate: innovation squared over its variance. Beyond it the error of wheels or gyro is not covered by the model. */
static const omni_real_t turn_gate = 25.0f;

/* Wheels skid if the mean innovation over about eight slots, squared, exceeds this fraction of its variance. For white
 * innovations the expected value is 1/15. */
static const omni_real_t skid_gate = 0.3f;
static const omni_real_t skid_mean_weight = 0.125f;

/* Process noise of a slip ratio per slot while wheels skid: (0.05 / sqrt(s))^2. */
static const omni_real_t skid_noise = 1e-5f;

/* Scalar measurement by the turn of a slot. */
typedef struct turn_measurement_t {
    omni_real_t h[OMNI_EKF_ERROR_STATES]; /* sensitivity to the error states */
    omni_real_t innovation;
    omni_real_t noise; /* variance of the innovation */
    omni_real_t creep; /* variance by creep of the wheels, correlated over slots */
    bool at_rest;
    bool apply;
} turn_measurement_t;

void omni_pose_ekf_start_gyro(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config) {
    for (int i = BIAS; i <= SCALE; ++i) {
        for (int a = 0; a < OMNI_EKF_STATES; ++a) {
            state->p[a][i] = 0.0f;
            state->p[i][a] = 0.0f;
        }
        state->p[i][i] = i == BIAS ? config->p_bias : config->p_scale;
        state->error_state[i - OMNI_AXES] = 0.0f;
        state->yaw_residual_mean_rad = 0.0f;
        for (int axis = 0; axis < OMNI_AXES; ++axis) {
            for (int slot = 0; slot < OMNI_EKF_HISTORY; ++slot) {
                state->history[slot].jacobian[axis][i - OMNI_AXES] = 0.0f;
            }
            state->last_propagated_slot.jacobian[axis][i - OMNI_AXES] = 0.0f;
        }
        for (int slot = 0; slot < OMNI_EKF_HISTORY; ++slot) {
            state->history[slot].error_state[i - OMNI_AXES] = 0.0f;
        }
    }
}

void omni_pose_ekf_get_gyro(const omni_pose_ekf_state_t *state, omni_ekf_gyro_calibration_t *known) {
    for (int i = 0; i < 2; ++i) {
        known->value[i] = state->error_state[OMNI_EKF_GYRO_BIAS + i];
        for (int j = 0; j < 2; ++j) {
            known->p[i][j] = state->p[BIAS + i][BIAS + j];
        }
    }
}

void omni_pose_ekf_set_gyro(omni_pose_ekf_state_t *state, const omni_ekf_gyro_calibration_t *known) {
    for (int i = 0; i < 2; ++i) {
        state->error_state[OMNI_EKF_GYRO_BIAS + i] = known->value[i];
        state->history[state->open_slot].error_state[OMNI_EKF_GYRO_BIAS + i] = known->value[i];
        for (int j = 0; j < 2; ++j) {
            state->p[BIAS + i][BIAS + j] = known->p[i][j];
        }
    }
}

/* Slip ratios change slowly, a skid does not: the innovation then keeps its sign for many slots. The measurement does
 * not identify the wheel. So it is not applied, and the variance of the ratios is raised. */
static bool detect_skid(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                        const turn_measurement_t *turn, omni_real_t variance) {
    const omni_real_t mean =
        state->yaw_residual_mean_rad + skid_mean_weight * (turn->innovation - state->yaw_residual_mean_rad);
    if (turn->apply) {
        state->yaw_residual_mean_rad = turn->at_rest ? 0.0f : mean;
    }
    const bool moves = turn->apply && !turn->at_rest;
    const bool skids = moves && mean * mean > skid_gate * (variance + turn->creep);
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        omni_real_t *known = &state->p[OMNI_AXES + i][OMNI_AXES + i];
        if (skids && turn->h[i] != 0.0f && *known < config->p_slip) {
            *known += skid_noise;
        }
    }
    return skids;
}

/* Apply the measurement. Bias and scale are corrected only at rest, as lasting slip looks like a scale error; while
 * driving they are consider states (Schmidt-Kalman filter). */
static void apply_gyro_correction(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                  const turn_measurement_t *turn) {
    const omni_real_t *h = turn->h;
    const omni_real_t innovation = turn->innovation;
    omni_real_t ph[OMNI_EKF_STATES];
    omni_real_t variance = turn->noise;
    for (int a = 0; a < OMNI_EKF_STATES; ++a) {
        ph[a] = 0.0f;
        for (int i = 0; i < OMNI_EKF_ERROR_STATES; ++i) {
            ph[a] += state->p[a][OMNI_AXES + i] * h[i];
        }
    }
    for (int i = 0; i < OMNI_EKF_ERROR_STATES; ++i) {
        variance += h[i] * ph[OMNI_AXES + i];
    }
    const bool skids = detect_skid(state, config, turn, variance);
    const bool near = variance > 0.0f && innovation * innovation <= turn_gate * variance;
    const bool fits = turn->apply && !skids && near;
    const omni_real_t inverse = fits ? 1.0f / variance : 0.0f;
    const omni_real_t of_gyro = turn->at_rest ? inverse : 0.0f;
    omni_real_t delta[OMNI_EKF_STATES];
    for (int a = 0; a < OMNI_EKF_STATES; ++a) {
        const omni_real_t gain = ph[a] * inverse;
        delta[a] = (a < BIAS ? gain : ph[a] * of_gyro) * innovation;
        for (int b = a; b < OMNI_EKF_STATES; ++b) {
            state->p[a][b] -= (a < BIAS ? gain : ph[a] * of_gyro) * ph[b];
            state->p[b][a] = state->p[a][b];
        }
    }
    omni_ekf_apply_correction(state, delta, OMNI_EKF_ERROR_STATES);
}

/*
 * The sensitivity uses the wheels' motion with the gyro's turn in place of their own. The quantisation of their turn is
 * already in the innovation; in the sensitivity, too, the product would have a mean.
 */
static void compute_gyro_measurement(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                     const omni_kinematics_t *k, uint8_t slip_states, bool rest, bool counts) {
    const omni_ekf_slot_t *slot = &state->history[state->open_slot];
    turn_measurement_t turn = {.at_rest = rest, .apply = counts};
    const omni_real_t scale = 1.0f + state->error_state[OMNI_EKF_GYRO_SCALE];
    const omni_real_t turned = state->slot_gyro_rad - state->error_state[OMNI_EKF_GYRO_BIAS] * state->slot_gyro_s;
    omni_real_t apart = scale * turned;
    omni_real_t weight = 0.0f; /* turn variance per wheel variance [1/m^2] */
    for (uint8_t i = 0; i < slip_states; ++i) {
        apart -= k->b_pinv[2][i] * state->slot_wheel_m[i] * (1.0f - state->error_state[i]);
        weight += k->b_pinv[2][i] * k->b_pinv[2][i];
    }
    for (uint8_t i = 0; i < slip_states; ++i) {
        turn.h[i] = rest ? 0.0f : k->b_pinv[2][i] * (state->slot_wheel_m[i] + k->b[i][2] * apart);
    }
    turn.h[OMNI_EKF_GYRO_BIAS] = -scale * state->slot_gyro_s;
    turn.h[OMNI_EKF_GYRO_SCALE] = rest ? 0.0f : turned;
    turn.innovation = -apart;
    turn.creep = weight * config->r_null;
    /* slot->steps contains the wheels' noise factor, which does not apply to the gyro. */
    const omni_real_t of_gyro = config->q_gyro * (state->slot_gyro_s / config->step_s);
    const omni_real_t noise = of_gyro + (rest ? 0.0f : config->q_theta * slot->steps);
    const omni_real_t least = rest ? 0.0f : weight * config->r_count;
    turn.noise = omni_maxf(noise, least);
    apply_gyro_correction(state, config, &turn);
}

void omni_pose_ekf_undo_gyro_turn(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                  const omni_kinematics_t *k, omni_real_t turned_rad, omni_real_t duration_s,
                                  omni_real_t doubt_rad) {
    const omni_real_t delta[OMNI_EKF_STATES] = {0.0f, 0.0f, -omni_wrap_pi(turned_rad)};
    const omni_real_t doubt = doubt_rad * doubt_rad;
    omni_pose_ekf_propagate_covariance(state, config, k);
    state->p[2][2] += config->q_theta * state->pose_noise_factor * duration_s / config->step_s;
    state->p[2][2] += omni_minf(doubt, OMNI_EKF_UNKNOWN_HEADING_VARIANCE);
    omni_ekf_apply_correction(state, delta, OMNI_EKF_ERROR_STATES);
}

void omni_ekf_correct_with_gyro(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                const omni_kinematics_t *k, uint8_t slip_states) {
    const omni_real_t all = (omni_real_t)state->slot_ticks;
    const bool rest = state->slot_rest_ticks == all;
    const bool turns = slip_states > 0 && state->slot_gyro_ticks == all;
    const bool counts = rest || turns;
    if (counts) {
        compute_gyro_measurement(state, config, k, slip_states, rest, counts);
    }
    state->slot_gyro_rad = 0.0f;
    state->slot_gyro_s = 0.0f;
    state->slot_rest_ticks = 0.0f;
    state->slot_gyro_ticks = 0.0f;
}

void omni_ekf_propagate_covariance_gyro(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                        const omni_kinematics_t *k, uint8_t slip_states) {
    propagate_covariance(state, config, k, slip_states, OMNI_EKF_ERROR_STATES);
}

void omni_ekf_add_pending_gyro_noise(omni_pose_ekf_state_t *state) {
    state->p[2][2] += state->pending_turn_noise;
    state->pending_turn_noise = 0.0f;
}

void omni_pose_ekf_predict_gyro(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                const omni_kinematics_t *k, const omni_real_t *wheel_delta_rad,
                                const omni_ekf_gyro_rate_t *turn, uint64_t time_us) {
    predict_motion(state, config, k, wheel_delta_rad, turn, time_us);
}

bool omni_ekf_history_window_full(const omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                  const omni_kinematics_t *k, uint32_t age_us, omni_ekf_window_t *window) {
    return fill_window(state, config, k, age_us, window, OMNI_EKF_ERROR_STATES,
                       state->flow_slots > 0 ? state->flow_noise_removed : NULL);
}
