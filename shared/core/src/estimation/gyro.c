/* SPDX-License-Identifier: MIT */
#include "omni/gyro.h"

#include <string.h>

#include "../math/math_inline.h"
#include "pose_ekf_inline.h"

static const omni_real_t first_window_rad = 0.25f;
static const omni_real_t later_window_rad = 3.0f;
static const omni_real_t slowest_compared_rad_s = 0.1f; /* below it the wheels' speed is mostly rounding of counts */
static const omni_real_t quiet_rad_s = 0.02f;
static const uint64_t longest_pause_us = 100000; /* without a tick of its own it has been off meanwhile */

/* A gyro that is new, or configured anew, has everything to learn. */
static void begin_anew(omni_gyro_state_t *state, const omni_gyro_config_t *config, const omni_gyro_tick_t *tick,
                       omni_pose_ekf_state_t *ekf, const omni_pose_ekf_config_t *ekf_config) {
    const bool paused = tick->time_us > state->time_us && tick->time_us - state->time_us > longest_pause_us;
    if (paused || state->axis != config->axis || state->scale != config->scale) {
        memset(state, 0, sizeof *state);
        state->axis = config->axis;
        state->scale = config->scale;
        state->window_rad = first_window_rad;
        omni_pose_ekf_start_gyro(ekf, ekf_config);
    }
    state->time_us = tick->time_us;
}

static void take_sample(omni_gyro_state_t *state, const omni_gyro_config_t *config, omni_real_t reading) {
    const omni_flag_t same = reading == state->reading;
    state->same_samples = omni_select(same, state->same_samples + 1u, 0u);
    state->reading = reading;
    state->silent_ticks = 0;
    if (!(omni_absf(reading) < config->range_rad_s) || state->same_samples >= (uint32_t)OMNI_GYRO_STUCK_SAMPLES) {
        state->good_samples = 0;
        state->trouble = true;
        return;
    }
    state->rate_rad_s = config->scale * (config->axis < 0 ? -reading : reading);
    state->good_samples = (uint16_t)(state->good_samples + (state->good_samples < OMNI_GYRO_GOOD_SAMPLES ? 1 : 0));
    state->trouble = state->trouble && state->good_samples < OMNI_GYRO_GOOD_SAMPLES;
}

/* @return may the newest reading be used? */
static bool read_gyro(omni_gyro_state_t *state, const omni_gyro_config_t *config, const omni_gyro_tick_t *tick) {
    const int axis = (config->axis < 0 ? -config->axis : config->axis) - 1;
    if ((tick->valid >> axis & 1) != 0) {
        take_sample(state, config, tick->reading[axis]);
    } else if (state->silent_ticks <= OMNI_GYRO_HOLD_TICKS) {
        ++state->silent_ticks;
    }
    if (state->silent_ticks > OMNI_GYRO_HOLD_TICKS) {
        state->good_samples = 0;
        state->trouble = true;
    }
    return state->good_samples >= OMNI_GYRO_GOOD_SAMPLES && !state->rejected && tick->timed;
}

/* Is the robot at rest? A bias that has jumped looks like a robot that is carried, but for longer. */
static omni_flag_t is_at_rest(omni_gyro_state_t *state, const omni_gyro_tick_t *tick, omni_pose_ekf_state_t *ekf,
                              const omni_pose_ekf_config_t *ekf_config) {
    const omni_real_t bias_sd = omni_sqrtf(omni_pose_ekf_bias_variance(ekf));
    const omni_real_t turns = omni_absf(state->rate_rad_s - omni_pose_ekf_bias(ekf));
    const omni_flag_t quiet = turns < quiet_rad_s + 5.0f * bias_sd;
    const omni_flag_t quietly = tick->still && quiet;
    state->still_ticks = omni_select(tick->still, state->still_ticks + 1u, 0u);
    state->rest_ticks = omni_select(quietly, state->rest_ticks + 1u, 0u);
    if (state->rest_ticks > (uint32_t)OMNI_GYRO_REST_TICKS) {
        state->still_ticks = OMNI_GYRO_REST_TICKS;
        state->rest_ticks = OMNI_GYRO_REST_TICKS;
    }
    if (state->still_ticks >= (uint32_t)OMNI_GYRO_ANEW_TICKS) {
        state->still_ticks = 0;
        state->ready = false;
        omni_pose_ekf_start_gyro(ekf, ekf_config);
    }
    return state->rest_ticks >= (uint32_t)OMNI_GYRO_REST_TICKS;
}

/* The wheels may slip, but not turn the body the other way for long. */
static void compare_with_wheels(omni_gyro_state_t *state, const omni_gyro_tick_t *tick, omni_pose_ekf_state_t *ekf,
                                const omni_pose_ekf_config_t *ekf_config, const omni_kinematics_t *k) {
    const omni_real_t wheels_rad = tick->wheels_rad_s * tick->duration_s;
    const omni_real_t gyro_rad = (state->rate_rad_s - omni_pose_ekf_bias(ekf)) * tick->duration_s;
    const omni_flag_t compared = omni_absf(tick->wheels_rad_s) > slowest_compared_rad_s;
    state->turned_rad += omni_select(compared, omni_absf(wheels_rad), 0.0f);
    state->same_rad += omni_select(compared, omni_select(wheels_rad > 0.0f, gyro_rad, -gyro_rad), 0.0f);
    state->apart_rad += omni_select(state->turn.leads, gyro_rad - wheels_rad, 0.0f);
    state->apart_s += omni_select(state->turn.leads, tick->duration_s, 0.0f);
    const omni_flag_t full = state->turned_rad > state->window_rad;
    const omni_flag_t too_little = state->same_rad < 0.5f * state->turned_rad;
    const omni_flag_t too_much = state->same_rad > 2.0f * state->turned_rad;
    const omni_flag_t wrong = full && (too_little || too_much);
    if (wrong) {
        state->rejected = true;
        state->turn.leads = false;
        omni_pose_ekf_turn_back(ekf, ekf_config, k, state->apart_rad, state->apart_s);
    }
    state->window_rad = omni_select(full, later_window_rad, state->window_rad);
    state->turned_rad = omni_select(full, 0.0f, state->turned_rad);
    state->same_rad = omni_select(full, 0.0f, state->same_rad);
    state->apart_rad = omni_select(full, 0.0f, state->apart_rad);
    state->apart_s = omni_select(full, 0.0f, state->apart_s);
}

bool omni_gyro_step(omni_gyro_state_t *state, const omni_gyro_config_t *config, const omni_gyro_tick_t *tick,
                    omni_pose_ekf_state_t *ekf, const omni_pose_ekf_config_t *ekf_config, const omni_kinematics_t *k) {
    begin_anew(state, config, tick, ekf, ekf_config);
    state->turn.leads = false;
    state->turn.rest = false;
    state->turn.rate_rad_s = 0.0f;
    if (read_gyro(state, config, tick)) {
        state->turn.rate_rad_s = state->rate_rad_s;
        state->turn.rest = is_at_rest(state, tick, ekf, ekf_config);
        if (!state->ready && omni_pose_ekf_bias_variance(ekf) < 0.01f * ekf_config->p_bias) {
            state->ready = true;
        }
        if (state->ready) {
            state->turn.leads = !state->turn.rest;
            compare_with_wheels(state, tick, ekf, ekf_config, k);
        }
    } else {
        state->rest_ticks = 0;
    }
    return !state->trouble && !state->rejected;
}
