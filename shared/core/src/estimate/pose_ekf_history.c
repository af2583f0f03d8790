/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "../math/invariant.h"
#include "pose_ekf_window.h"

/* Prior of a mean of 0, as a distance: after 1 m the observed mean has half of the weight. */
static const omni_real_t slip_mean_prior_distance_m = 1.0f;

/* Averaging distance of the mean: limited because the floor may change. */
static const omni_real_t max_mean_distance_m = 10.0f;

bool omni_ekf_history_add(omni_pose_ekf_state_t *state, const omni_ekf_motion_t *motion, bool has_gyro) {
    OMNI_INVARIANT(state->open_slot < OMNI_EKF_HISTORY && state->slot_ticks < OMNI_EKF_SLOT_TICKS);
    omni_ekf_slot_t *slot = &state->history[state->open_slot];
    slot->move[0] += state->slot_cosine * motion->move[0] + state->slot_sine * motion->move[1];
    slot->move[1] += state->slot_cosine * motion->move[1] - state->slot_sine * motion->move[0];
    slot->move[2] += motion->move[2];
    slot->steps += motion->noise_steps;
    if (has_gyro) {
        slot->turn_noise += motion->turn_noise;
    }
    slot->duration_us += motion->duration_us;
    ++state->slot_ticks;
    state->unpropagated_ticks = (uint8_t)(state->unpropagated_ticks + 1);
    return state->slot_ticks >= OMNI_EKF_SLOT_TICKS || slot->duration_us >= OMNI_EKF_SLOT_US;
}

void omni_ekf_history_next(omni_pose_ekf_state_t *state) {
    state->history[state->open_slot].ticks = state->slot_ticks;
    state->open_slot = (uint16_t)((state->open_slot + 1) % OMNI_EKF_HISTORY);
    state->complete_slots =
        (uint8_t)(state->complete_slots < OMNI_EKF_HISTORY - 1 ? state->complete_slots + 1 : state->complete_slots);
    state->slot_ticks = 0;
    state->unpropagated_ticks = 0;
    omni_ekf_slot_t *slot = &state->history[state->open_slot];
    memset(slot, 0, sizeof *slot);
    memset(state->slot_wheel_m, 0, sizeof state->slot_wheel_m);
    state->flow_noise_removed[state->open_slot][0] = 0.0f;
    state->flow_noise_removed[state->open_slot][1] = 0.0f;
    state->flow_slots = (uint8_t)(state->flow_slots > 0 ? state->flow_slots - 1 : 0);
    memcpy(slot->error_state, state->error_state, sizeof slot->error_state);
    omni_sincosf(state->pose.theta, &state->slot_sine, &state->slot_cosine);
}

void omni_ekf_history_rebase(omni_pose_ekf_state_t *state, uint8_t error_states) {
    omni_ekf_slot_t *slot = &state->history[state->open_slot];
    for (uint8_t i = 0; i < error_states; ++i) {
        const omni_real_t change = state->error_state[i] - slot->error_state[i];
        for (int axis = 0; axis < OMNI_AXES; ++axis) {
            slot->move[axis] += slot->jacobian[axis][i] * change;
            state->last_propagated_slot.move[axis] += slot->jacobian[axis][i] * change;
        }
    }
    memcpy(slot->error_state, state->error_state, sizeof slot->error_state);
    omni_sincosf(state->pose.theta - slot->move[2], &state->slot_sine, &state->slot_cosine);
}

bool omni_ekf_history_window(const omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                             const omni_kinematics_t *k, uint32_t age_us, omni_ekf_window_t *window) {
    /* A constant number of states lets the compiler unroll the loops. Three wheels and no slip are the common cases. */
    const uint8_t error_states = omni_ekf_error_states(config, k);
    const bool measured = state->flow_slots > 0;
    if (error_states == 3 && !measured) {
        return fill_window(state, config, k, age_us, window, 3, NULL);
    }
    if (error_states == OMNI_EKF_ERROR_STATES || measured) {
        return omni_ekf_history_window_full(state, config, k, age_us, window);
    }
    OMNI_INVARIANT(error_states == 0 || error_states == OMNI_MAX_WHEELS);
    return error_states == 0 ? fill_window(state, config, k, age_us, window, 0, NULL)
                             : fill_window(state, config, k, age_us, window, OMNI_MAX_WHEELS, NULL);
}

/* A slip ratio is observable for this time after a fix. */
static const uint64_t slip_observed_after_fix_us = 250000;

/* Shift the ratio in each slot of the history, too, so that slots keep their difference to the current ratio. */
static void shift_slip_ratio(omni_pose_ekf_state_t *state, uint8_t wheel, omni_real_t step) {
    state->error_state[wheel] += step;
    for (int slot = 0; slot < OMNI_EKF_HISTORY; ++slot) {
        state->history[slot].error_state[wheel] += step;
    }
}

static void update_slip_mean(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, uint8_t wheel,
                             bool seen) {
    const omni_real_t rolled = omni_absf(state->slot_wheel_m[wheel]);
    const omni_real_t way = state->mean_slip_distance_m[wheel] + rolled;
    const omni_flag_t known = state->p[OMNI_AXES + wheel][OMNI_AXES + wheel] < 0.5f * config->p_slip;
    const omni_real_t share = omni_select(seen && known, rolled / (way + slip_mean_prior_distance_m), 0.0f);
    state->mean_slip[wheel] += share * (state->error_state[wheel] - state->mean_slip[wheel]);
    const omni_real_t limited = omni_minf(way, max_mean_distance_m);
    state->mean_slip_distance_m[wheel] = omni_select(seen && known, limited, state->mean_slip_distance_m[wheel]);
}

static void revert_to_slip_mean(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, uint8_t wheel,
                                bool seen) {
    const omni_real_t trust =
        state->mean_slip_distance_m[wheel] / (state->mean_slip_distance_m[wheel] + slip_mean_prior_distance_m);
    const omni_real_t step = config->mean_reversion * trust * (state->mean_slip[wheel] - state->error_state[wheel]);
    const omni_flag_t returns = !seen && state->slot_wheel_m[wheel] != 0.0f && step != 0.0f;
    if (omni_any(returns)) {
        shift_slip_ratio(state, wheel, omni_select(returns, step, 0.0f));
    }
}

void omni_ekf_update_slip_means(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                uint8_t slip_states) {
    const bool fixed = state->last_fix_us != 0 && state->time_us - state->last_fix_us <= slip_observed_after_fix_us;
    const bool alone = !fixed && omni_ekf_is_dead_reckoning(state->last_absolute_update_us, state->time_us);
    const bool seen = fixed || state->flow_slots > 0;
    for (uint8_t i = 0; i < slip_states; ++i) {
        if (seen) {
            update_slip_mean(state, config, i, seen);
        }
        if (alone) {
            revert_to_slip_mean(state, config, i, seen);
        }
    }
}
