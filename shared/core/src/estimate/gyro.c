/* SPDX-License-Identifier: MIT */
#include "omni/gyro.h"

#include <string.h>

#include "../math/math_inline.h"
#include "pose_ekf_inline.h"

static const omni_real_t first_window_rad = 0.25f;
static const omni_real_t later_window_rad = 3.0f;
static const omni_real_t slowest_compared_rad_s = 0.1f; /* below it the wheels' speed is mostly rounding of counts */
static const omni_real_t blind_share = 0.1f;
static const omni_real_t slowest_creep_rad_s = 0.01f;
static const omni_real_t fastest_creep_rad_s = 0.2f;
static const omni_real_t quiet_rad_s = 0.02f;
static const uint64_t hold_us = 1000000;
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
    return state->good_samples >= OMNI_GYRO_GOOD_SAMPLES && tick->timed;
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

/* Take back what it turned the heading beyond the wheels. A wrong sign is no doubt of the wheels. Anything else may be
 * a skid, so the heading is as unsure as that. */
static void reject_gyro(omni_gyro_state_t *state, omni_pose_ekf_state_t *ekf, const omni_pose_ekf_config_t *ekf_config,
                        const omni_kinematics_t *k, omni_flag_t opposite) {
    const omni_real_t doubt_rad = omni_select(opposite, 0.0f, state->apart_rad);
    state->rejected = true;
    state->turn.leads = false;
    omni_pose_ekf_turn_back(ekf, ekf_config, k, state->apart_rad, state->apart_s, doubt_rad);
    state->apart_rad = 0.0f;
    state->apart_s = 0.0f;
}

/* Has the gyro turned the same way, half as far to twice as far? It is believed for some windows: the wheels of a
 * robot that is held, or skids, turn alone. One that has agreed before has neither a wrong sign nor a wrong scale. It
 * can only have gone blind. */
static void judge_window(omni_gyro_state_t *state, omni_pose_ekf_state_t *ekf, const omni_pose_ekf_config_t *ekf_config,
                         const omni_kinematics_t *k) {
    const omni_flag_t proven = state->proven > 0u;
    const omni_flag_t full = state->turned_rad > state->window_rad;
    const omni_flag_t alike = state->same_rad > 0.5f * state->turned_rad && state->same_rad < 2.0f * state->turned_rad;
    const omni_flag_t right = full && alike;
    const omni_flag_t wrong = full && !alike && (!proven || state->seen_rad < blind_share * state->turned_rad);
    const omni_flag_t opposite = wrong && state->same_rad < -0.5f * state->turned_rad;
    const omni_flag_t often = state->wrong_windows >= (omni_uint_t)(OMNI_GYRO_WINDOWS - 1);
    const omni_flag_t enough = wrong && (often || opposite);
    state->wrong_windows = omni_select(wrong && !enough, state->wrong_windows + 1u, state->wrong_windows);
    state->wrong_windows = omni_select((full && !wrong) || enough, 0u, state->wrong_windows);
    state->proven = omni_select(right, 1u, omni_select(enough, 0u, state->proven));
    if (state->rejected) {
        const omni_flag_t close =
            state->same_rad > 0.8f * state->turned_rad && state->same_rad < 1.25f * state->turned_rad;
        state->rejected = !(full && close);
    } else if (enough) {
        reject_gyro(state, ekf, ekf_config, k, opposite);
    }
    state->apart_rad = omni_select(full && !wrong, 0.0f, state->apart_rad);
    state->apart_s = omni_select(full && !wrong, 0.0f, state->apart_s);
    const omni_flag_t long_ones = state->proven > 0u || state->rejected;
    state->window_rad =
        omni_select(full, omni_select(long_ones, later_window_rad, first_window_rad), state->window_rad);
    state->turned_rad = omni_select(full, 0.0f, state->turned_rad);
    state->same_rad = omni_select(full, 0.0f, state->same_rad);
    state->seen_rad = omni_select(full, 0.0f, state->seen_rad);
}

/* Only while motors drive: a wheel that a person turns by hand says nothing of the body. */
static void compare_with_wheels(omni_gyro_state_t *state, const omni_gyro_tick_t *tick, omni_pose_ekf_state_t *ekf,
                                const omni_pose_ekf_config_t *ekf_config, const omni_kinematics_t *k) {
    const omni_real_t wheels_rad = tick->wheels_rad_s * tick->duration_s;
    const omni_real_t gyro_rad = (state->rate_rad_s - omni_pose_ekf_bias(ekf)) * tick->duration_s;
    const omni_flag_t compared = tick->driven && omni_absf(tick->wheels_rad_s) > slowest_compared_rad_s;
    const omni_flag_t followed = tick->driven && state->turn.leads;
    state->turned_rad += omni_select(compared, omni_absf(wheels_rad), 0.0f);
    state->same_rad += omni_select(compared, omni_select(wheels_rad > 0.0f, gyro_rad, -gyro_rad), 0.0f);
    state->seen_rad += omni_select(compared, omni_absf(gyro_rad), 0.0f);
    state->apart_rad += omni_select(followed, gyro_rad - wheels_rad, 0.0f);
    state->apart_s += omni_select(followed, tick->duration_s, 0.0f);
    judge_window(state, ekf, ekf_config, k);
    state->hold_wheels_rad += omni_select(followed, wheels_rad, 0.0f);
    state->hold_gyro_rad += omni_select(followed, gyro_rad, 0.0f);
    state->hold_x_m += omni_select(followed, tick->wheels_x_m_s * tick->duration_s, 0.0f);
    state->hold_y_m += omni_select(followed, tick->wheels_y_m_s * tick->duration_s, 0.0f);
    state->hold_s += omni_select(followed, tick->duration_s, 0.0f);
}

/* The bias has moved by what the wheels turned the body in the window, and the gyro did not see. */
static void move_bias(omni_gyro_state_t *state, omni_pose_ekf_state_t *ekf, const omni_pose_ekf_config_t *ekf_config,
                      const omni_kinematics_t *k) {
    const omni_real_t moved_rad_s = (state->hold_gyro_rad - state->hold_wheels_rad) / state->hold_s;
    omni_ekf_gyro_t known;
    omni_pose_ekf_turn_back(ekf, ekf_config, k, state->creep_rad, state->creep_s, state->creep_rad);
    omni_pose_ekf_get_gyro(ekf, &known);
    omni_pose_ekf_start_gyro(ekf, ekf_config);
    known.value[0] += moved_rad_s;
    known.p[0][0] = 0.0625f * moved_rad_s * moved_rad_s;
    known.p[0][1] = 0.0f;
    known.p[1][0] = 0.0f;
    omni_pose_ekf_set_gyro(ekf, &known);
    state->told_ticks = OMNI_GYRO_TOLD_TICKS + 1u;
    state->hold_seconds = 0;
    state->apart_rad = 0.0f;
    state->apart_s = 0.0f;
}

/* A bias that steps turns the estimated heading. A robot that holds its heading then turns itself with its wheels, by
 * as much, and the gyro sees nothing of it. A second is over: did the wheels turn the robot slowly on the spot, as in
 * the second before? */
static void judge_hold(omni_gyro_state_t *state, omni_pose_ekf_state_t *ekf, const omni_pose_ekf_config_t *ekf_config,
                       const omni_kinematics_t *k) {
    const omni_real_t turned = omni_absf(state->hold_wheels_rad);
    const omni_flag_t slow =
        turned > slowest_creep_rad_s * state->hold_s && turned < fastest_creep_rad_s * state->hold_s;
    const omni_flag_t unseen = omni_absf(state->hold_gyro_rad) < 0.25f * turned;
    const omni_real_t way_m = omni_absf(state->hold_x_m) + omni_absf(state->hold_y_m);
    const omni_flag_t on_the_spot = way_m < 3.0f * turned * omni_absf(k->b[0][2]);
    const omni_flag_t steady = omni_absf(state->hold_wheels_rad - state->hold_before_rad) < 0.5f * turned;
    const omni_flag_t creeps = slow && unseen && on_the_spot && steady;
    const omni_real_t apart_rad = state->hold_gyro_rad - state->hold_wheels_rad;
    state->creep_rad = omni_select(creeps, state->creep_rad + apart_rad, 0.0f);
    state->creep_s = omni_select(creeps, state->creep_s + state->hold_s, 0.0f);
    state->hold_seconds = omni_select(creeps, state->hold_seconds + 1u, 0u);
    if (state->hold_seconds >= (omni_uint_t)OMNI_GYRO_CREEP_SECONDS) {
        move_bias(state, ekf, ekf_config, k);
    }
    state->hold_before_rad = state->hold_wheels_rad;
    state->hold_wheels_rad = 0.0f;
    state->hold_gyro_rad = 0.0f;
    state->hold_x_m = 0.0f;
    state->hold_y_m = 0.0f;
    state->hold_s = 0.0f;
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
            state->turn.leads = !state->turn.rest && !state->rejected;
            compare_with_wheels(state, tick, ekf, ekf_config, k);
        }
    } else {
        state->rest_ticks = 0;
    }
    if (tick->time_us >= state->hold_end_us) {
        judge_hold(state, ekf, ekf_config, k);
        state->hold_end_us = tick->time_us + hold_us;
    }
    state->told_ticks = omni_select(state->told_ticks > 0u, state->told_ticks - 1u, 0u);
    return !state->trouble && !state->rejected && !(state->told_ticks > 0u);
}
