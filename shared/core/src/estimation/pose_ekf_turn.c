/* SPDX-License-Identifier: MIT */
/* What gyro and wheels say of the same turn measures slip ratios, bias and scale: see omni/pose_ekf.h. */
#include "pose_ekf_motion.h"
#include "pose_ekf_window.h"

enum { BIAS = OMNI_AXES + OMNI_EKF_BIAS, SCALE = OMNI_AXES + OMNI_EKF_SCALE };

/* Square of the innovation over its variance beyond which wheels or gyro are off by more than the model knows. */
static const omni_real_t turn_gate = 25.0f;

void omni_pose_ekf_start_gyro(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config) {
    for (int i = BIAS; i <= SCALE; ++i) {
        for (int a = 0; a < OMNI_EKF_STATES; ++a) {
            state->p[a][i] = 0.0f;
            state->p[i][a] = 0.0f;
        }
        state->p[i][i] = i == BIAS ? config->p_bias : config->p_scale;
        state->slip[i - OMNI_AXES] = 0.0f;
        for (int slot = 0; slot < OMNI_EKF_HISTORY; ++slot) {
            for (int axis = 0; axis < OMNI_AXES; ++axis) {
                state->history[slot].gain[axis][i - OMNI_AXES] = 0.0f;
            }
            state->history[slot].slip[i - OMNI_AXES] = 0.0f;
        }
    }
}

void omni_pose_ekf_get_gyro(const omni_pose_ekf_state_t *state, omni_ekf_gyro_t *known) {
    for (int i = 0; i < 2; ++i) {
        known->value[i] = state->slip[OMNI_EKF_BIAS + i];
        for (int j = 0; j < 2; ++j) {
            known->p[i][j] = state->p[BIAS + i][BIAS + j];
        }
    }
}

void omni_pose_ekf_set_gyro(omni_pose_ekf_state_t *state, const omni_ekf_gyro_t *known) {
    for (int i = 0; i < 2; ++i) {
        state->slip[OMNI_EKF_BIAS + i] = known->value[i];
        state->history[state->newest].slip[OMNI_EKF_BIAS + i] = known->value[i];
        for (int j = 0; j < 2; ++j) {
            state->p[BIAS + i][BIAS + j] = known->p[i][j];
        }
    }
}

/* A scalar measurement; h has an entry per state after the pose. It teaches bias and scale only at `rest`: slip that
 * lasts looks like a wrong scale. What the filter does not know of them counts all the same (Schmidt's filter). Nothing
 * changes unless it `counts`. */
static void correct_by_turn(omni_pose_ekf_state_t *state, const omni_real_t *h, omni_real_t innovation,
                            omni_real_t noise, omni_flag_t rest, omni_flag_t counts) {
    omni_real_t ph[OMNI_EKF_STATES];
    omni_real_t variance = noise;
    for (int a = 0; a < OMNI_EKF_STATES; ++a) {
        ph[a] = 0.0f;
        for (int i = 0; i < OMNI_EKF_COLUMNS; ++i) {
            ph[a] += state->p[a][OMNI_AXES + i] * h[i];
        }
    }
    for (int i = 0; i < OMNI_EKF_COLUMNS; ++i) {
        variance += h[i] * ph[OMNI_AXES + i];
    }
    const omni_flag_t fits = counts && variance > 0.0f && innovation * innovation <= turn_gate * variance;
    const omni_real_t inverse = omni_select(fits, 1.0f / variance, 0.0f);
    const omni_real_t of_gyro = omni_select(rest, inverse, 0.0f);
    omni_real_t delta[OMNI_EKF_STATES];
    for (int a = 0; a < OMNI_EKF_STATES; ++a) {
        const omni_real_t gain = ph[a] * inverse;
        delta[a] = (a < BIAS ? gain : ph[a] * of_gyro) * innovation;
        for (int b = a; b < OMNI_EKF_STATES; ++b) {
            state->p[a][b] -= (a < BIAS ? gain : ph[a] * of_gyro) * ph[b];
            state->p[b][a] = state->p[a][b];
        }
    }
    omni_ekf_shift(state, delta, OMNI_EKF_COLUMNS);
}

/*
 * The sensitivity takes the wheels' motion with the gyro's turn in place of their own. The counts' rounding in their
 * turn is in the innovation already. If it were in the gain too, the product would not average out.
 */
static void measure_turn(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, const omni_kinematics_t *k,
                         uint8_t slips, omni_flag_t rest, omni_flag_t counts) {
    const omni_ekf_slot_t *slot = &state->history[state->newest];
    omni_real_t h[OMNI_EKF_COLUMNS] = {0};
    const omni_real_t scale = 1.0f + state->slip[OMNI_EKF_SCALE];
    const omni_real_t turned = state->slot_turn_rad - state->slip[OMNI_EKF_BIAS] * state->slot_turn_s;
    omni_real_t apart = scale * turned;
    for (uint8_t i = 0; i < slips; ++i) {
        apart -= k->b_pinv[2][i] * state->wheel_m[i] * (1.0f - state->slip[i]);
    }
    for (uint8_t i = 0; i < slips; ++i) {
        h[i] = omni_select(rest, 0.0f, k->b_pinv[2][i] * (state->wheel_m[i] + k->b[i][2] * apart));
    }
    h[OMNI_EKF_BIAS] = -scale * state->slot_turn_s;
    h[OMNI_EKF_SCALE] = omni_select(rest, 0.0f, turned);
    const omni_real_t of_gyro =
        config->q_turn / state->noise_factor; /* lambda, which is in the steps, is the wheels' */
    const omni_real_t noise = (of_gyro + omni_select(rest, 0.0f, config->q_theta)) * slot->steps;
    correct_by_turn(state, h, -apart, noise, rest, counts);
}

void omni_pose_ekf_turn_back(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, omni_real_t turned_rad,
                             omni_real_t duration_s) {
    const omni_real_t delta[OMNI_EKF_STATES] = {0.0f, 0.0f, -turned_rad};
    state->p[2][2] += config->q_theta * duration_s / config->step_s;
    omni_ekf_shift(state, delta, OMNI_EKF_COLUMNS);
}

void omni_ekf_use_turn(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, const omni_kinematics_t *k,
                       uint8_t slips) {
    const omni_real_t all = (omni_real_t)OMNI_EKF_SLOT_TICKS;
    const omni_flag_t rest = state->slot_rest == all;
    const omni_flag_t turns = slips > 0 && state->slot_turns == all;
    const omni_flag_t counts = rest || turns;
    if (omni_any(counts)) {
        measure_turn(state, config, k, slips, rest, counts);
    }
    state->slot_turn_rad = 0.0f;
    state->slot_turn_s = 0.0f;
    state->slot_rest = 0.0f;
    state->slot_turns = 0.0f;
}

void omni_ekf_settle_turn_noise(omni_pose_ekf_state_t *state) {
    state->p[2][2] += state->turn_noise;
    state->turn_noise = 0.0f;
}

void omni_pose_ekf_predict_turn(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                const omni_kinematics_t *k, const omni_real_t *wheel_delta_rad,
                                const omni_ekf_turn_t *turn, uint64_t time_us) {
    predict_motion(state, config, k, wheel_delta_rad, turn, time_us);
}

bool omni_ekf_turn_window(const omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                          const omni_kinematics_t *k, uint32_t age_us, omni_ekf_window_t *window) {
    return fill_window(state, config, k, age_us, window, OMNI_EKF_COLUMNS, config->flow ? state->flow_known : NULL);
}
