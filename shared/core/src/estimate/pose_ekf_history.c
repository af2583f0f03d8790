/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "../math/invariant.h"
#include "pose_ekf_window.h"

/* What a wheel rolls before its mean counts half: until then it may as well be as told, and not slip. */
static const omni_real_t mean_prior_m = 1.0f;

/* The mean is taken over so much at most: the floor may change. */
static const omni_real_t mean_way_m = 10.0f;

bool omni_ekf_history_add(omni_pose_ekf_state_t *state, const omni_ekf_motion_t *motion, bool has_gyro) {
    OMNI_INVARIANT(state->newest < OMNI_EKF_HISTORY && state->slot_tick < OMNI_EKF_SLOT_TICKS);
    omni_ekf_slot_t *slot = &state->history[state->newest];
    slot->move[0] += state->slot_cosine * motion->move[0] + state->slot_sine * motion->move[1];
    slot->move[1] += state->slot_cosine * motion->move[1] - state->slot_sine * motion->move[0];
    slot->move[2] += motion->move[2];
    slot->steps += motion->noise_steps;
    if (has_gyro) {
        slot->turn_noise += motion->turn_noise;
    }
    slot->duration_us += motion->duration_us;
    ++state->slot_tick;
    state->unsettled_ticks = (uint8_t)(state->unsettled_ticks + 1);
    return state->slot_tick >= OMNI_EKF_SLOT_TICKS || slot->duration_us >= OMNI_EKF_SLOT_US;
}

void omni_ekf_history_next(omni_pose_ekf_state_t *state) {
    state->history[state->newest].ticks = state->slot_tick;
    state->newest = (uint16_t)((state->newest + 1) % OMNI_EKF_HISTORY);
    state->filled = (uint8_t)(state->filled < OMNI_EKF_HISTORY - 1 ? state->filled + 1 : state->filled);
    state->slot_tick = 0;
    state->unsettled_ticks = 0;
    omni_ekf_slot_t *slot = &state->history[state->newest];
    memset(slot, 0, sizeof *slot);
    memset(state->wheel_m, 0, sizeof state->wheel_m);
    state->flow_known[state->newest][0] = 0.0f;
    state->flow_known[state->newest][1] = 0.0f;
    state->flow_slots = omni_select(state->flow_slots > 0, state->flow_slots - 1, (omni_int_t)0);
    memcpy(slot->slip, state->slip, sizeof slot->slip);
    omni_sincosf(state->pose.theta, &state->slot_sine, &state->slot_cosine);
}

void omni_ekf_history_rebase(omni_pose_ekf_state_t *state, uint8_t columns) {
    omni_ekf_slot_t *slot = &state->history[state->newest];
    for (uint8_t i = 0; i < columns; ++i) {
        const omni_real_t change = state->slip[i] - slot->slip[i];
        for (int axis = 0; axis < OMNI_AXES; ++axis) {
            slot->move[axis] += slot->gain[axis][i] * change;
            state->settled.move[axis] += slot->gain[axis][i] * change;
        }
    }
    memcpy(slot->slip, state->slip, sizeof slot->slip);
    omni_sincosf(state->pose.theta - slot->move[2], &state->slot_sine, &state->slot_cosine);
}

bool omni_ekf_history_window(const omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                             const omni_kinematics_t *k, uint32_t age_us, omni_ekf_window_t *window) {
    /* The count as a constant lets the compiler unroll the loops; three wheels and no slip are the ones to be fast. */
    const uint8_t columns = omni_ekf_columns(config, k);
    const bool measured = state->flow_slots > 0;
    if (columns == 3 && !measured) {
        return fill_window(state, config, k, age_us, window, 3, NULL);
    }
    if (columns == OMNI_EKF_COLUMNS || measured) {
        return omni_ekf_turn_window(state, config, k, age_us, window);
    }
    OMNI_INVARIANT(columns == 0 || columns == OMNI_MAX_WHEELS);
    return columns == 0 ? fill_window(state, config, k, age_us, window, 0, NULL)
                        : fill_window(state, config, k, age_us, window, OMNI_MAX_WHEELS, NULL);
}

/* A ratio is seen as long after a fix. Later it is only what it was. */
static const uint64_t mean_fix_us = 250000;

/* Each slot of the history moves by as much. So a late fix still finds what its slip ratios were then. */
static void move_slip(omni_pose_ekf_state_t *state, uint8_t wheel, omni_real_t step) {
    state->slip[wheel] += step;
    for (int slot = 0; slot < OMNI_EKF_HISTORY; ++slot) {
        state->history[slot].slip[wheel] += step;
    }
}

static void learn_mean(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, uint8_t wheel,
                       omni_flag_t seen) {
    const omni_real_t rolled = omni_absf(state->wheel_m[wheel]);
    const omni_real_t way = state->mean_way_m[wheel] + rolled;
    const omni_flag_t known = state->p[OMNI_AXES + wheel][OMNI_AXES + wheel] < 0.5f * config->p_slip;
    const omni_real_t share = omni_select(seen && known, rolled / (way + mean_prior_m), 0.0f);
    state->mean_slip[wheel] += share * (state->slip[wheel] - state->mean_slip[wheel]);
    const omni_real_t limited = omni_select(way < mean_way_m, way, mean_way_m);
    state->mean_way_m[wheel] = omni_select(seen && known, limited, state->mean_way_m[wheel]);
}

static void return_to_mean(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, uint8_t wheel,
                           omni_flag_t seen) {
    const omni_real_t trust = state->mean_way_m[wheel] / (state->mean_way_m[wheel] + mean_prior_m);
    const omni_real_t step = config->mean_rate * trust * (state->mean_slip[wheel] - state->slip[wheel]);
    const omni_flag_t returns = !seen && state->wheel_m[wheel] != 0.0f && step != 0.0f;
    if (omni_any(returns)) {
        move_slip(state, wheel, omni_select(returns, step, 0.0f));
    }
}

void omni_ekf_follow_mean(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, uint8_t slips) {
    const bool fixed = state->last_fix_us != 0 && state->time_us - state->last_fix_us <= mean_fix_us;
    const bool alone = !fixed && omni_ekf_is_alone(state->told_us, state->time_us);
    const omni_flag_t seen = fixed || state->flow_slots > 0;
    for (uint8_t i = 0; i < slips; ++i) {
        if (omni_any(seen)) {
            learn_mean(state, config, i, seen);
        }
        if (alone) {
            return_to_mean(state, config, i, seen);
        }
    }
}
