/* SPDX-License-Identifier: MIT */
#include "omni/flow.h"

#include <string.h>

#include "../math/math_inline.h"

static const omni_real_t flow_largest_m = 1.0f; /* 4 m/s over the reach of the pose EKF's history */
static const omni_real_t flow_largest_rad = OMNI_PI_F;
static const omni_real_t flow_zero_m = 0.02f;
static const omni_real_t flow_proof_m = 0.001f; /* a robot that stands proves nothing of where a sensor points, */
static const omni_real_t flow_proof_sds = 4.0f; /* nor does a way that could be the sensor's noise */
static const omni_real_t flow_repeat_m = 0.001f;
static const omni_real_t flow_repeat_share = 0.1f;
static const omni_real_t flow_few_zeros_m = 0.002f;   /* a slow robot moves less than the sensor's steps */
static const uint64_t flow_longest_pause_us = 100000; /* without a tick of its own it has been off meanwhile */
static const uint64_t flow_hold_us = (uint64_t)OMNI_FLOW_HOLD_TICKS * 1000u;

/* Memory may differ where no member does: each is compared. */
static bool same_flow(const omni_flow_config_t *a, const omni_flow_config_t *b) {
    return a->axes == b->axes && a->delay_us == b->delay_us && a->cosine == b->cosine && a->sine == b->sine &&
           a->scale == b->scale && a->arm_m[0] == b->arm_m[0] && a->arm_m[1] == b->arm_m[1];
}

/* A sensor that is new, or configured anew, has to prove itself. */
static void begin_flow(omni_flow_state_t *state, const omni_flow_config_t *config, const omni_flow_tick_t *tick,
                       omni_pose_ekf_state_t *ekf) {
    const bool paused = tick->time_us > state->time_us && tick->time_us - state->time_us > flow_longest_pause_us;
    if (paused || !same_flow(&state->config, config)) {
        memset(state, 0, sizeof *state);
        state->good_us = tick->time_us;
        omni_pose_ekf_start_flow(ekf);
    }
    state->config = *config;
    state->time_us = tick->time_us;
}

/* The reading, in body axes. */
static void turn_reading(const omni_flow_config_t *config, const omni_real_t *reading, omni_ekf_flow_t *flow) {
    flow->move[0] = config->scale * (config->cosine * reading[0] - config->sine * reading[1]);
    flow->move[1] = config->scale * (config->sine * reading[0] + config->cosine * reading[1]);
    flow->move[2] = flow->turns ? reading[2] : 0.0f;
    flow->arm_m[0] = config->arm_m[0];
    flow->arm_m[1] = config->arm_m[1];
    flow->r_xy = config->r_xy + config->r_share * (flow->move[0] * flow->move[0] + flow->move[1] * flow->move[1]);
    flow->r_turn = config->r_turn;
}

static omni_flag_t can_be_true(const omni_ekf_flow_t *flow) {
    const omni_real_t far = omni_absf(flow->move[0]) + omni_absf(flow->move[1]);
    return far < flow_largest_m && omni_absf(flow->move[2]) < flow_largest_rad; /* false for NaN */
}

/* Does it repeat its last reading while the wheels do not? Before slip ratios have learned what is not so. */
static void look_for_repeats(omni_flow_state_t *state, const omni_real_t *reading,
                             const omni_ekf_flow_result_t *result) {
    const omni_flag_t zero = reading[0] == 0.0f && reading[1] == 0.0f;
    const omni_flag_t same = reading[0] == state->last[0] && reading[1] == state->last[1] && !zero;
    omni_real_t way = 0.0f;
    omni_real_t change = 0.0f;
    for (int axis = 0; axis < 2; ++axis) {
        state->last[axis] = reading[axis];
        state->rolled_m[axis] = omni_select(same, state->rolled_m[axis], result->rolled_m[axis]);
        way += omni_absf(state->rolled_m[axis]);
        change += omni_absf(result->rolled_m[axis] - state->rolled_m[axis]);
    }
    state->repeats = omni_select(same, state->repeats + 1u, 0u);
    const omni_flag_t other = change > flow_repeat_m + flow_repeat_share * way;
    state->frozen = same && (state->frozen || (state->repeats >= (uint32_t)OMNI_FLOW_REPEATS && other));
}

/* What follows from a reading that fits, or does not. */
static void judge_reading(omni_flow_state_t *state, const omni_ekf_flow_result_t *result, omni_pose_ekf_state_t *ekf,
                          const omni_pose_ekf_config_t *ekf_config, const omni_kinematics_t *k) {
    const omni_real_t proof2 = flow_proof_sds * flow_proof_sds * state->config.r_xy;
    const omni_flag_t fits = result->fits;
    const omni_flag_t stuck = state->zero_m > flow_zero_m || state->frozen;
    const omni_flag_t moves = result->expected_m > flow_proof_m && result->expected_m * result->expected_m > proof2;
    const omni_flag_t proves = fits && !stuck;
    state->good = omni_select(proves, omni_select(moves, state->good + 1u, state->good), 0u);
    state->refused_in_row = omni_select(fits, 0u, state->refused_in_row + 1u);
    state->refused = omni_select(fits, state->refused, state->refused + 1u);
    const omni_flag_t slips = result->apart_m < 0.5f * result->expected_m; /* no slip turns the way aside */
    const omni_flag_t doubt = state->refused_in_row == (uint32_t)OMNI_FLOW_DOUBT && slips;
    if (doubt) {
        omni_pose_ekf_doubt_slips(ekf, ekf_config, k);
    }
    const omni_flag_t proved = state->good >= (uint32_t)OMNI_FLOW_GOOD;
    const omni_flag_t failed = stuck || state->refused_in_row >= (uint32_t)OMNI_FLOW_REFUSED;
    state->trouble = failed || (state->trouble && !proved);
}

static void use_reading(omni_flow_state_t *state, const omni_flow_config_t *config, const omni_flow_tick_t *tick,
                        uint64_t since_us, omni_pose_ekf_state_t *ekf, const omni_pose_ekf_config_t *ekf_config,
                        const omni_kinematics_t *k) {
    omni_ekf_flow_t flow;
    omni_ekf_flow_result_t result;
    const uint64_t span_us = tick->time_us - since_us;
    if (since_us == 0 || span_us == 0 || span_us > flow_hold_us || !tick->timed) {
        return; /* nobody knows since when it has been counting, or the history may not reach back that far */
    }
    flow.turns = config->axes > 2 && (tick->valid & (uint32_t)OMNI_FLOW_TURN) != 0u;
    flow.age_us = config->delay_us;
    flow.span_us = (uint32_t)span_us;
    turn_reading(config, tick->reading, &flow);
    if (!can_be_true(&flow)) {
        state->good = 0u;
        state->refused = state->refused + 1u;
        return;
    }
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        state->sum[axis] += flow.move[axis];
    }
    const omni_flag_t zero = tick->reading[0] == 0.0f && tick->reading[1] == 0.0f;
    const omni_flag_t proved = state->good >= (uint32_t)OMNI_FLOW_GOOD;
    const omni_flag_t trusted = proved || (!state->trouble && state->used > 0u);
    flow.counts = trusted && !(zero && state->zero_m > flow_few_zeros_m);
    if (!omni_pose_ekf_correct_flow(ekf, ekf_config, k, &flow, &result)) {
        return; /* the estimate has begun anew meanwhile */
    }
    state->nis = result.nis;
    state->zero_m = omni_select(zero, state->zero_m + result.expected_m, 0.0f);
    look_for_repeats(state, tick->reading, &result);
    judge_reading(state, &result, ekf, ekf_config, k);
    state->used = omni_select(result.fits && flow.counts, state->used + 1u, state->used);
    state->good_us = tick->time_us;
}

omni_flag_t omni_flow_step(omni_flow_state_t *state, const omni_flow_config_t *config, const omni_flow_tick_t *tick,
                           omni_pose_ekf_state_t *ekf, const omni_pose_ekf_config_t *ekf_config,
                           const omni_kinematics_t *k) {
    begin_flow(state, config, tick, ekf);
    omni_pose_ekf_follow_flow(ekf);
    if ((tick->valid & (uint32_t)OMNI_FLOW_READ) != 0u) {
        const uint64_t since_us = state->read_us;
        state->read_us = tick->time_us;
        if ((tick->valid & (uint32_t)OMNI_FLOW_XY) == (uint32_t)OMNI_FLOW_XY) {
            use_reading(state, config, tick, since_us, ekf, ekf_config, k);
        }
    }
    if (tick->time_us > state->good_us && tick->time_us - state->good_us > flow_hold_us) {
        state->good = 0u;
        state->trouble = true;
    }
    return !state->trouble;
}
