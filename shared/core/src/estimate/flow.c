/* SPDX-License-Identifier: MIT */
#include "omni/flow.h"

#include <string.h>

#include "../math/math_inline.h"

static const omni_real_t flow_largest_m = 1.0f; /* 4 m/s over the reach of the pose EKF's history */
static const omni_real_t flow_largest_rad = OMNI_PI_F;
static const omni_real_t flow_zero_m = 0.02f;
static const omni_real_t flow_proof_m = 0.001f;
static const omni_real_t flow_proof_sds = 4.0f;
static const omni_real_t flow_lead_sds = 12.0f;
static const omni_real_t flow_led_gate = 0.25f;       /* of the gate, while the wheels may still spin */
static const omni_real_t flow_lead_noise_m_s = 0.03f; /* steps of the sensor, seen as a speed */
static const omni_real_t flow_still_m = 0.1f;         /* on ice a body may take so long to start */
static const omni_real_t flow_odd_share = 0.25f;      /* of how far a reading is from the wheels */
static const omni_real_t flow_spin_share = 0.15f;     /* of the way, at a wheel: one of three slips by 45 % */
static const omni_real_t flow_repeat_m = 0.001f;
static const omni_real_t flow_repeat_share = 0.1f;
static const omni_real_t flow_few_zeros_m = 0.002f; /* a slow robot moves less than the sensor's steps */
static const omni_real_t flow_share_step = 0.02f;
static const omni_real_t flow_share_most = 0.5f;
static const omni_real_t flow_reach_m = 2.0f; /* of the sums that tell the direction */
static const omni_real_t flow_direction_m = 0.5f;
static const omni_real_t flow_two_ways = 0.05f; /* least product of the squares along two axes over their sum squared */
static const omni_real_t flow_longest = 2.0f;   /* times the wheels' way */
static const omni_real_t flow_off_sd_rad = 0.04f; /* by the readings' noise */
static const omni_real_t flow_off_rad = 0.15f;
static const omni_real_t flow_off_led_rad = 0.25f; /* while wheels that spin may be in the sums */
static const omni_real_t flow_led_m = 0.1f;
static const omni_real_t flow_right_rad = 0.075f;     /* below it a sensor that was askew points right again */
static const uint64_t flow_longest_pause_us = 100000; /* without a tick of its own it has been off meanwhile */
static const uint64_t flow_hold_us = (uint64_t)OMNI_FLOW_HOLD_TICKS * 1000u;

/* Memory may differ where no member does: each is compared. */
static bool same_flow(const omni_flow_config_t *a, const omni_flow_config_t *b) {
    return a->axes == b->axes && a->delay_us == b->delay_us && a->cosine == b->cosine && a->sine == b->sine &&
           a->scale == b->scale && a->arm_m[0] == b->arm_m[0] && a->arm_m[1] == b->arm_m[1];
}

/* A sensor that is new, or configured anew, has to prove itself. */
static void begin_flow(omni_flow_state_t *state, const omni_flow_config_t *config, const omni_flow_tick_t *tick) {
    const bool paused = tick->time_us > state->time_us && tick->time_us - state->time_us > flow_longest_pause_us;
    if (paused || !same_flow(&state->config, config)) {
        memset(state, 0, sizeof *state);
        state->good_us = tick->time_us;
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

/* How far the wheels have moved while it said zero. Counts that flicker add up to nothing. */
static omni_real_t zero_way(const omni_flow_state_t *state) {
    return omni_sqrtf(state->zero_m[0] * state->zero_m[0] + state->zero_m[1] * state->zero_m[1]);
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
        state->rolled_m[axis] = omni_select(same, state->rolled_m[axis], result->rolled[axis]);
        way += omni_absf(state->rolled_m[axis]);
        change += omni_absf(result->rolled[axis] - state->rolled_m[axis]);
    }
    state->repeats = omni_select(same, state->repeats + 1u, 0u);
    const omni_flag_t other = change > flow_repeat_m + flow_repeat_share * way;
    state->frozen = same && (state->frozen || (state->repeats >= (uint32_t)OMNI_FLOW_REPEATS && other));
}

/* Share of a sum over the last flow_reach_m that is left after a reading. */
static omni_real_t kept_over(omni_real_t way_m) {
    const omni_real_t left = 1.0f - way_m / flow_reach_m;
    return omni_select(left > 0.0f, left, 0.0f);
}

/* How far the pose of now is from where the wheels without slip would have it, by the last readings. A fix has put
 * right what was before it. */
static void note_taken(omni_flow_state_t *state, const omni_ekf_flow_result_t *result, omni_flag_t counts,
                       const omni_pose_ekf_state_t *ekf) {
    const omni_real_t kept = omni_select(state->fixes == ekf->accepted, kept_over(result->expected_m), 0.0f);
    omni_real_t more[OMNI_AXES];
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        more[axis] = omni_select(counts, result->seen[axis], result->moved[axis]) - result->rolled[axis];
    }
    omni_real_t sine;
    omni_real_t cosine;
    omni_sincosf(ekf->pose.theta, &sine, &cosine);
    const omni_real_t stays = omni_select(state->fixes == ekf->accepted && state->led > 0u, 1.0f, 0.0f);
    const omni_real_t leads = omni_select(result->led, 1.0f, 0.0f);
    state->led_way[0] = stays * state->led_way[0] + leads * (cosine * more[0] - sine * more[1]);
    state->led_way[1] = stays * state->led_way[1] + leads * (sine * more[0] + cosine * more[1]);
    state->led_way[2] = stays * state->led_way[2] + leads * more[2];
    state->taken[0] = kept * state->taken[0] + cosine * more[0] - sine * more[1];
    state->taken[1] = kept * state->taken[1] + sine * more[0] + cosine * more[1];
    state->taken[2] = kept * state->taken[2] + more[2];
    state->fixes = ekf->accepted;
}

/* A robot that stands proves nothing of where a sensor points, nor does a way that could be the sensor's noise. */
static omni_flag_t is_proof(const omni_flow_state_t *state, omni_real_t way2) {
    return way2 > flow_proof_m * flow_proof_m && way2 > flow_proof_sds * flow_proof_sds * state->config.r_xy;
}

/* Has the speed changed by no more than wheels on a floor can change it? The one before is turned into today's axes. */
static omni_flag_t could_be_driven(omni_flow_state_t *state, const omni_ekf_flow_t *flow, uint64_t time_us) {
    const uint64_t since_us = time_us - state->pace_us;
    const omni_real_t since_s = (omni_real_t)(since_us < flow_hold_us ? since_us : flow_hold_us) * 1e-6f;
    const omni_real_t most = (omni_real_t)OMNI_FLOW_MOST_M_S2 * since_s + flow_lead_noise_m_s;
    const omni_real_t span_s = (omni_real_t)flow->span_us * 1e-6f;
    omni_real_t sine;
    omni_real_t cosine;
    omni_sincosf(flow->move[2], &sine, &cosine);
    const omni_real_t before[2] = {cosine * state->pace_m_s[0] + sine * state->pace_m_s[1],
                                   cosine * state->pace_m_s[1] - sine * state->pace_m_s[0]};
    omni_real_t change2 = 0.0f;
    for (int axis = 0; axis < 2; ++axis) {
        const omni_real_t pace = flow->move[axis] / span_s;
        change2 += (pace - before[axis]) * (pace - before[axis]);
        state->pace_m_s[axis] = pace;
    }
    state->pace_us = time_us;
    return change2 < most * most;
}

/* Does it say that the body stands, along an axis along which the wheels move? */
static omni_flag_t is_still(const omni_flow_state_t *state) {
    return omni_absf(state->still_m[0]) > flow_still_m || omni_absf(state->still_m[1]) > flow_still_m;
}

/* May it be believed against the wheels? Not against pose fixes. */
static omni_flag_t may_lead(omni_flow_state_t *state, const omni_ekf_flow_t *flow, uint64_t time_us,
                            const omni_pose_ekf_state_t *ekf) {
    const omni_flag_t may_go_on = could_be_driven(state, flow, time_us) && state->led < (omni_uint_t)OMNI_FLOW_LED;
    state->long_fits = omni_select(may_go_on, state->long_fits, 0u);
    return state->right && state->long_fits >= (omni_uint_t)OMNI_FLOW_LEAD && !state->frozen && !state->askew &&
           !is_still(state) && ekf->refused_in_row == 0;
}

/* It has led, and that was wrong: the pose is as unsure as it has moved it. It must prove itself anew. */
static void end_lead(omni_flow_state_t *state, omni_flag_t wrong, omni_pose_ekf_state_t *ekf,
                     const omni_pose_ekf_config_t *ekf_config, const omni_kinematics_t *k) {
    if (omni_any(wrong && state->led > 0u)) {
        omni_real_t doubt[OMNI_AXES];
        for (int axis = 0; axis < OMNI_AXES; ++axis) {
            doubt[axis] = omni_select(wrong, state->led_way[axis], 0.0f);
        }
        omni_pose_ekf_doubt_pose(ekf, ekf_config, k, doubt);
    }
    state->led = omni_select(wrong, 0u, state->led);
    state->leads = state->leads && !wrong;
    state->long_fits = omni_select(wrong, 0u, state->long_fits);
}

/* Is the reading as if the sensor pointed elsewhere? That changes no turn and no length. A wheel that spins, or slides,
 * changes the turn by half as much as the way, at the wheels' radius. Without anything that measures the turn there is
 * only the length. @param d the wheels' motion. @param turn_m how far the turn is from theirs, at a wheel */
static omni_flag_t is_turned(const omni_real_t *d, const omni_real_t *z, omni_real_t turn_m) {
    const omni_real_t apart_m = omni_sqrtf((z[0] - d[0]) * (z[0] - d[0]) + (z[1] - d[1]) * (z[1] - d[1]));
    const omni_real_t longer_m = omni_sqrtf(z[0] * z[0] + z[1] * z[1]) - omni_sqrtf(d[0] * d[0] + d[1] * d[1]);
    const omni_real_t most_m = flow_odd_share * apart_m;
    return omni_absf(turn_m) < most_m && omni_absf(longer_m) < most_m;
}

/* Is a wheel wrong, or does the sensor point elsewhere? */
static void tell_apart(omni_flow_state_t *state, const omni_ekf_flow_t *flow, const omni_ekf_flow_result_t *result,
                       const omni_pose_ekf_state_t *ekf, const omni_pose_ekf_config_t *ekf_config,
                       const omni_kinematics_t *k) {
    const omni_real_t slot_s = (omni_real_t)OMNI_EKF_SLOT_TICKS * ekf_config->step_s;
    const omni_real_t by_gyro = ekf_config->gyro ? ekf->turn_apart * (omni_real_t)flow->span_us * 1e-6f / slot_s : 0.0f;
    const bool turns = flow->turns && !ekf_config->gyro;
    const omni_real_t turn_m = k->b[0][2] * (turns ? result->seen[2] - result->rolled[2] : by_gyro);
    const omni_real_t *d = result->rolled;
    const omni_flag_t spins = turn_m * turn_m > flow_spin_share * flow_spin_share * (d[0] * d[0] + d[1] * d[1]);
    const omni_real_t known_m = k->b[0][2] * (turns ? result->seen[2] - result->moved[2] : by_gyro);
    state->odd = is_turned(d, result->seen, turn_m) || is_turned(result->moved, result->seen, known_m);
    const omni_flag_t turns_alike =
        omni_absf(turn_m) < flow_odd_share * result->apart_m; /* a spinning wheel's does not */
    for (int axis = 0; axis < 2; ++axis) {
        const omni_real_t z = result->seen[axis];
        const omni_flag_t nothing = z * z < flow_proof_sds * flow_proof_sds * state->config.r_xy;
        const omni_real_t more_m = omni_select(turns_alike, result->rolled[axis] - z, 0.0f);
        state->still_m[axis] = omni_select(nothing, state->still_m[axis] + more_m, 0.0f);
    }
    const omni_real_t unclear_m = turns ? 0.0f : result->expected_m;
    state->led_m = kept_over(result->expected_m) * state->led_m + omni_select(result->led, unclear_m, 0.0f);
    const omni_uint_t more = omni_select(result->led, state->odd_in_row + 1u, state->odd_in_row);
    state->odd_in_row = omni_select(state->odd || result->fits, more, 0u);
    const omni_flag_t often = state->odd_in_row >= (omni_uint_t)OMNI_FLOW_ODD;
    state->tells = (result->led && often) || (!result->led && !spins);
}

/* Where does it point, seen from where the wheels say it moved? A reading that is far too long says nothing. */
static void compare_directions(omni_flow_state_t *state, const omni_ekf_flow_result_t *result) {
    const omni_real_t *d = result->rolled;
    const omni_real_t *z = result->seen;
    const omni_real_t d2 = d[0] * d[0] + d[1] * d[1];
    const omni_real_t z2 = z[0] * z[0] + z[1] * z[1];
    const omni_flag_t tells = is_proof(state, d2) && z2 < flow_longest * flow_longest * d2 && state->tells;
    const omni_real_t way = omni_select(tells, omni_sqrtf(d2), 0.0f);
    const omni_real_t weight = omni_select(tells, 1.0f, 0.0f);
    const omni_real_t kept = kept_over(way);
    state->way_m = kept * state->way_m + way;
    omni_real_t *dd = state->wheels_m2;
    dd[0] = kept * dd[0] + weight * d[0] * d[0];
    dd[1] = kept * dd[1] + weight * d[0] * d[1];
    dd[2] = kept * dd[2] + weight * d[1] * d[1];
    for (int row = 0; row < 2; ++row) {
        for (int column = 0; column < 2; ++column) {
            const omni_real_t product = omni_select(tells, z[row] * d[column], 0.0f);
            state->both_m2[row][column] = kept * state->both_m2[row][column] + product;
        }
    }
    const omni_real_t(*zd)[2] = (const omni_real_t(*)[2])state->both_m2;
    const omni_real_t sum = dd[0] + dd[2];
    const omni_real_t spread = dd[0] * dd[2] - dd[1] * dd[1];
    const omni_flag_t sure = result->noise_m2 * sum < 4.0f * flow_off_sd_rad * flow_off_sd_rad * spread;
    state->knows = state->way_m > flow_direction_m && spread > flow_two_ways * sum * sum && sure;
    const omni_real_t turned = zd[1][0] * dd[2] - zd[1][1] * dd[1] + zd[0][0] * dd[1] - zd[0][1] * dd[0];
    const omni_real_t along = zd[0][0] * dd[2] - zd[0][1] * dd[1] - zd[1][0] * dd[1] + zd[1][1] * dd[0];
    state->off_rad = omni_select(state->knows, omni_atan2f(turned, along), 0.0f);
}

/* A sensor that points elsewhere has taught what is not so. So has one that does not fit soon after it was first used.
 * Of one that has been right for longer, or hangs, or leads, what it has taught stays. */
static void judge_lessons(omni_flow_state_t *state, omni_flag_t stays, omni_pose_ekf_state_t *ekf,
                          const omni_pose_ekf_config_t *ekf_config, const omni_kinematics_t *k) {
    const omni_flag_t before = state->askew;
    const omni_real_t first = omni_select(state->led_m > flow_led_m, flow_off_led_rad, flow_off_rad);
    const omni_flag_t off = omni_absf(state->off_rad) > omni_select(before, flow_right_rad, first);
    state->askew = (state->knows && off) || (!state->knows && before);
    const omni_flag_t refused = state->refused_in_row == (omni_uint_t)OMNI_FLOW_REFUSED && !stays;
    const omni_flag_t wrong = (state->askew && !before) || (refused && state->counted_m < flow_reach_m);
    if (wrong && state->counted_m > 0.0f) {
        omni_pose_ekf_take_back_flow(ekf, ekf_config, k, state->taken);
        memset(state->taken, 0, sizeof state->taken);
        state->counted_m = 0.0f;
    }
}

/* The floor may have changed: no slip turns the way aside. Then the slip ratios count as unknown, once, and again
 * every OMNI_FLOW_AGAIN readings. A sensor that has never been used must be known to point right. */
static omni_flag_t may_be_floor(const omni_flow_state_t *state, const omni_ekf_flow_result_t *result) {
    const omni_flag_t slips = result->apart_m < 0.5f * result->expected_m;
    const omni_flag_t right = state->knows && omni_absf(state->off_rad) < flow_right_rad;
    const omni_flag_t due = state->unfit_in_row % (omni_uint_t)OMNI_FLOW_AGAIN == (omni_uint_t)OMNI_FLOW_DOUBT;
    return due && slips && !state->askew && (state->used > 0u || right);
}

/* What follows from a reading that fits, or does not. */
static void judge_reading(omni_flow_state_t *state, const omni_ekf_flow_result_t *result, omni_pose_ekf_state_t *ekf,
                          const omni_pose_ekf_config_t *ekf_config, const omni_kinematics_t *k) {
    const omni_flag_t fits = result->fits;
    const omni_flag_t refused = !fits && !result->led;
    state->unfit_in_row = omni_select(fits, 0u, state->unfit_in_row + 1u);
    state->refused_in_row =
        omni_select(refused, state->refused_in_row + 1u, omni_select(fits, 0u, state->refused_in_row));
    state->refused = omni_select(refused, state->refused + 1u, state->refused);
    const omni_flag_t hangs = zero_way(state) > flow_zero_m || state->frozen;
    judge_lessons(state, hangs || result->led, ekf, ekf_config, k);
    const omni_flag_t moves = is_proof(state, result->expected_m * result->expected_m);
    const omni_flag_t proves = fits && !hangs && !state->askew;
    state->good = omni_select(proves, omni_select(moves, state->good + 1u, state->good), 0u);
    const omni_real_t far_m2 = flow_lead_sds * flow_lead_sds * state->config.r_xy;
    const omni_flag_t far = result->expected_m * result->expected_m > far_m2;
    state->long_fits = omni_select(proves && far, state->long_fits + 1u, state->long_fits);
    if (may_be_floor(state, result)) {
        omni_pose_ekf_doubt_slips(ekf, ekf_config, k);
    }
    const omni_real_t share = state->refused_share;
    state->refused_share = share + flow_share_step * (omni_select(refused, 1.0f, 0.0f) - share);
    const omni_flag_t proved = state->good >= (uint32_t)OMNI_FLOW_GOOD;
    const omni_flag_t too_many = state->refused_in_row >= (uint32_t)OMNI_FLOW_REFUSED;
    const omni_flag_t failed = hangs || state->askew || too_many || state->refused_share > flow_share_most;
    const omni_flag_t over = state->trouble && proved && !failed;
    state->refused_share = omni_select(over, 0.0f, state->refused_share);
    state->trouble = failed || (state->trouble && !proved);
    state->trusted = !state->trouble && (state->trusted || proved);
    state->long_fits = omni_select(state->trusted, state->long_fits, 0u);
    const omni_flag_t straight = state->knows && omni_absf(state->off_rad) < flow_right_rad;
    state->right = state->trusted && (state->right || straight);
    state->leads = result->led || (state->leads && !refused && !proved);
    const omni_uint_t fewer = omni_select(fits && state->led > 0u, state->led - 1u, state->led);
    state->led = omni_select(result->led, state->led + 1u, fewer);
    end_lead(state, state->trouble || ekf->refused_in_row > 0, ekf, ekf_config, k);
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
    flow.counts = state->trusted && !(zero && zero_way(state) > flow_few_zeros_m);
    const omni_real_t gate = omni_select(state->leads, flow_led_gate, 1.0f) * ekf_config->flow_gate;
    flow.lead_nis = omni_select(may_lead(state, &flow, tick->time_us, ekf), gate, 0.0f);
    if (!omni_pose_ekf_correct_flow(ekf, ekf_config, k, &flow, &result)) {
        return; /* the estimate has begun anew meanwhile */
    }
    state->nis = result.nis;
    for (int axis = 0; axis < 2; ++axis) {
        state->zero_m[axis] = omni_select(zero, state->zero_m[axis] + result.rolled[axis], 0.0f);
    }
    tell_apart(state, &flow, &result, ekf, ekf_config, k);
    compare_directions(state, &result);
    const omni_flag_t counted = flow.counts && (result.fits || result.led);
    note_taken(state, &result, counted, ekf);
    look_for_repeats(state, tick->reading, &result);
    const bool fixed = ekf->last_taken_us + flow.age_us + flow.span_us > ekf->time_us;
    if (!fixed || omni_any(result.fits || flow.lead_nis == 0.0f)) { /* it would lead, but for a fix within it */
        judge_reading(state, &result, ekf, ekf_config, k);
    }
    state->used = omni_select(counted, state->used + 1u, state->used);
    state->counted_m += omni_select(counted, result.expected_m, 0.0f);
    state->good_us = tick->time_us;
    state->silent = false;
}

omni_flag_t omni_flow_step(omni_flow_state_t *state, const omni_flow_config_t *config, const omni_flow_tick_t *tick,
                           omni_pose_ekf_state_t *ekf, const omni_pose_ekf_config_t *ekf_config,
                           const omni_kinematics_t *k) {
    begin_flow(state, config, tick);
    if ((tick->valid & (uint32_t)OMNI_FLOW_READ) != 0u) {
        const uint64_t since_us = state->read_us;
        state->read_us = tick->time_us;
        const bool has_way = (tick->valid & (uint32_t)OMNI_FLOW_XY) == (uint32_t)OMNI_FLOW_XY;
        if (has_way) {
            use_reading(state, config, tick, since_us, ekf, ekf_config, k);
        }
        state->came = state->came + 1u;
        state->lost = state->lost + omni_select(has_way, 0u, 1u);
    }
    if (tick->time_us > state->good_us && tick->time_us - state->good_us > flow_hold_us) {
        state->good = 0u;
        state->silent = true;
        state->trusted = false;
    }
    return !state->trouble && !state->silent;
}
