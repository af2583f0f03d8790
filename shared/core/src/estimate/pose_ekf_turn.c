/* SPDX-License-Identifier: MIT */
/* What gyro and wheels say of the same turn measures slip ratios, bias and scale: see omni/pose_ekf.h. */
#include "pose_ekf_motion.h"
#include "pose_ekf_window.h"

enum { BIAS = OMNI_AXES + OMNI_EKF_BIAS, SCALE = OMNI_AXES + OMNI_EKF_SCALE };

/* Square of the innovation over its variance beyond which wheels or gyro are off by more than the model knows. */
static const omni_real_t turn_gate = 25.0f;

/* Wheels skid if the mean innovation, over about eight slots, has a square of more than this share of its variance.
 * White innovations of that variance have 1/15 of it. */
static const omni_real_t skid_gate = 0.3f;
static const omni_real_t skid_share = 0.125f;

/* Variance that a slip ratio gathers in a slot while wheels skid: 0.05 in the root of a second. */
static const omni_real_t skid_noise = 1e-5f;

/* What the turn of a slot says: h has an entry per state after the pose. */
typedef struct turn_measurement_t {
    omni_real_t h[OMNI_EKF_COLUMNS];
    omni_real_t innovation;
    omni_real_t noise; /* its variance */
    omni_real_t creep; /* variance that wheels on the floor may add, and for longer than a slot */
    omni_flag_t rest;
    omni_flag_t counts;
} turn_measurement_t;

void omni_pose_ekf_start_gyro(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config) {
    for (int i = BIAS; i <= SCALE; ++i) {
        for (int a = 0; a < OMNI_EKF_STATES; ++a) {
            state->p[a][i] = 0.0f;
            state->p[i][a] = 0.0f;
        }
        state->p[i][i] = i == BIAS ? config->p_bias : config->p_scale;
        state->slip[i - OMNI_AXES] = 0.0f;
        state->turn_apart = 0.0f;
        for (int axis = 0; axis < OMNI_AXES; ++axis) {
            for (int slot = 0; slot < OMNI_EKF_HISTORY; ++slot) {
                state->history[slot].gain[axis][i - OMNI_AXES] = 0.0f;
            }
            state->settled.gain[axis][i - OMNI_AXES] = 0.0f;
        }
        for (int slot = 0; slot < OMNI_EKF_HISTORY; ++slot) {
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

/* Slip ratios change slowly, and a skid does not: what wheels and gyro are apart then keeps its sign for many slots.
 * The measurement cannot tell which wheel it is. So it is left out, and the ratios become less sure. */
static omni_flag_t notice_skid(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                               const turn_measurement_t *turn, omni_real_t variance) {
    const omni_real_t mean = state->turn_apart + skid_share * (turn->innovation - state->turn_apart);
    state->turn_apart = omni_select(turn->counts, omni_select(turn->rest, 0.0f, mean), state->turn_apart);
    const omni_flag_t moves = turn->counts && !turn->rest;
    const omni_flag_t skids = moves && mean * mean > skid_gate * (variance + turn->creep);
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        omni_real_t *known = &state->p[OMNI_AXES + i][OMNI_AXES + i];
        *known += omni_select(skids && turn->h[i] != 0.0f && *known < config->p_slip, skid_noise, 0.0f);
    }
    return skids;
}

/* A scalar measurement. It teaches bias and scale only at rest: slip that lasts looks like a wrong scale. What the
 * filter does not know of them counts all the same (Schmidt's filter). Nothing changes unless it counts. */
static void correct_by_turn(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                            const turn_measurement_t *turn) {
    const omni_real_t *h = turn->h;
    const omni_real_t innovation = turn->innovation;
    omni_real_t ph[OMNI_EKF_STATES];
    omni_real_t variance = turn->noise;
    for (int a = 0; a < OMNI_EKF_STATES; ++a) {
        ph[a] = 0.0f;
        for (int i = 0; i < OMNI_EKF_COLUMNS; ++i) {
            ph[a] += state->p[a][OMNI_AXES + i] * h[i];
        }
    }
    for (int i = 0; i < OMNI_EKF_COLUMNS; ++i) {
        variance += h[i] * ph[OMNI_AXES + i];
    }
    const omni_flag_t skids = notice_skid(state, config, turn, variance);
    const omni_flag_t near = variance > 0.0f && innovation * innovation <= turn_gate * variance;
    const omni_flag_t fits = turn->counts && !skids && near;
    const omni_real_t inverse = omni_select(fits, 1.0f / variance, 0.0f);
    const omni_real_t of_gyro = omni_select(turn->rest, inverse, 0.0f);
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
    turn_measurement_t turn = {.rest = rest, .counts = counts};
    const omni_real_t scale = 1.0f + state->slip[OMNI_EKF_SCALE];
    const omni_real_t turned = state->slot_turn_rad - state->slip[OMNI_EKF_BIAS] * state->slot_turn_s;
    omni_real_t apart = scale * turned;
    omni_real_t weight = 0.0f; /* of a wheel's variance [1/m^2] */
    for (uint8_t i = 0; i < slips; ++i) {
        apart -= k->b_pinv[2][i] * state->wheel_m[i] * (1.0f - state->slip[i]);
        weight += k->b_pinv[2][i] * k->b_pinv[2][i];
    }
    for (uint8_t i = 0; i < slips; ++i) {
        turn.h[i] = omni_select(rest, 0.0f, k->b_pinv[2][i] * (state->wheel_m[i] + k->b[i][2] * apart));
    }
    turn.h[OMNI_EKF_BIAS] = -scale * state->slot_turn_s;
    turn.h[OMNI_EKF_SCALE] = omni_select(rest, 0.0f, turned);
    turn.innovation = -apart;
    turn.creep = weight * config->r_null;
    /* The slot's steps are times the wheels' factor, which is none of the gyro's. */
    const omni_real_t of_gyro = config->q_turn * (state->slot_turn_s / config->step_s);
    const omni_real_t noise = of_gyro + omni_select(rest, 0.0f, config->q_theta * slot->steps);
    const omni_real_t least = omni_select(rest, 0.0f, weight * config->r_count);
    turn.noise = omni_select(noise > least, noise, least);
    correct_by_turn(state, config, &turn);
}

void omni_pose_ekf_turn_back(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                             const omni_kinematics_t *k, omni_real_t turned_rad, omni_real_t duration_s,
                             omni_real_t doubt_rad) {
    const omni_real_t delta[OMNI_EKF_STATES] = {0.0f, 0.0f, -omni_wrap_pi(turned_rad)};
    const omni_real_t doubt = doubt_rad * doubt_rad;
    omni_pose_ekf_settle(state, config, k);
    state->p[2][2] += config->q_theta * state->white_factor * duration_s / config->step_s;
    state->p[2][2] += omni_select(doubt < OMNI_EKF_ANY_HEADING, doubt, OMNI_EKF_ANY_HEADING);
    omni_ekf_shift(state, delta, OMNI_EKF_COLUMNS);
}

void omni_ekf_use_turn(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, const omni_kinematics_t *k,
                       uint8_t slips) {
    const omni_real_t all = (omni_real_t)state->slot_tick;
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

void omni_ekf_settle_turn(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                          const omni_kinematics_t *k, uint8_t slips) {
    settle_columns(state, config, k, slips, OMNI_EKF_COLUMNS);
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
    return fill_window(state, config, k, age_us, window, OMNI_EKF_COLUMNS,
                       state->flow_slots > 0 ? state->flow_known : NULL);
}
