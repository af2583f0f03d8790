/* SPDX-License-Identifier: MIT */
#include "omni/gyro.h"

#include <string.h>

#include "../math/math_inline.h"
#include "../model/kinematics_inline.h"
#include "pose_ekf_inline.h"

static const omni_real_t first_window_rad = 0.25f;
static const omni_real_t later_window_rad = 3.0f;
static const omni_real_t min_compared_rate_rad_s = 0.1f; /* below it quantisation dominates the wheels' speed */
static const omni_real_t blind_fraction = 0.1f;
static const omni_real_t min_creep_rate_rad_s = 0.01f;
static const omni_real_t max_creep_rate_rad_s = 0.2f;
static const omni_real_t quiet_rad_s = 0.02f;
static const uint64_t hold_us = 1000000;
static const uint64_t restart_gap_us = 100000; /* a longer gap between ticks: the gyro has been off */

/* Restart for a new or reconfigured gyro. */
static void restart_gyro_if_reconfigured(omni_gyro_state_t *state, const omni_gyro_config_t *config,
                                         const omni_gyro_tick_t *tick, omni_pose_ekf_state_t *ekf,
                                         const omni_pose_ekf_config_t *ekf_config) {
    const bool paused = tick->time_us > state->time_us && tick->time_us - state->time_us > restart_gap_us;
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
    const bool same = reading == state->reading;
    state->repeated_samples = same ? state->repeated_samples + 1u : 0u;
    state->reading = reading;
    state->silent_ticks = 0;
    if (!(omni_absf(reading) < config->range_rad_s) || state->repeated_samples >= (uint32_t)OMNI_GYRO_STUCK_SAMPLES) {
        state->good_samples = 0;
        state->faulty = true;
        return;
    }
    state->rate_rad_s = config->scale * (config->axis < 0 ? -reading : reading);
    state->good_samples = (uint16_t)(state->good_samples + (state->good_samples < OMNI_GYRO_GOOD_SAMPLES ? 1 : 0));
    state->faulty = state->faulty && state->good_samples < OMNI_GYRO_GOOD_SAMPLES;
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
        state->faulty = true;
    }
    return state->good_samples >= OMNI_GYRO_GOOD_SAMPLES && tick->interval_valid;
}

/* Is the robot at rest? A bias step looks like a carried robot: after OMNI_GYRO_BIAS_RESTART_TICKS it is taken as one.
 */
static bool is_at_rest(omni_gyro_state_t *state, const omni_gyro_tick_t *tick, omni_pose_ekf_state_t *ekf,
                       const omni_pose_ekf_config_t *ekf_config) {
    const omni_real_t bias_sd = omni_sqrtf(omni_pose_ekf_bias_variance(ekf));
    const omni_real_t turns = omni_absf(state->rate_rad_s - omni_pose_ekf_bias(ekf));
    const bool quiet = turns < quiet_rad_s + 5.0f * bias_sd;
    const bool quietly = tick->wheels_still && quiet;
    state->wheels_still_ticks = tick->wheels_still ? state->wheels_still_ticks + 1u : 0u;
    state->rest_ticks = quietly ? state->rest_ticks + 1u : 0u;
    if (state->rest_ticks > (uint32_t)OMNI_GYRO_REST_TICKS) {
        state->wheels_still_ticks = OMNI_GYRO_REST_TICKS;
        state->rest_ticks = OMNI_GYRO_REST_TICKS;
    }
    if (state->wheels_still_ticks >= (uint32_t)OMNI_GYRO_BIAS_RESTART_TICKS) {
        state->wheels_still_ticks = 0;
        state->ready = false;
        omni_pose_ekf_start_gyro(ekf, ekf_config);
    }
    return state->rest_ticks >= (uint32_t)OMNI_GYRO_REST_TICKS;
}

/* Undo its heading change relative to the wheels. A wrong sign excludes a skid; otherwise the wheels may have skidded,
 * and the change is added to the heading's deviation. */
static void reject_gyro(omni_gyro_state_t *state, omni_pose_ekf_state_t *ekf, const omni_pose_ekf_config_t *ekf_config,
                        const omni_kinematics_t *k, bool opposite) {
    const omni_real_t doubt_rad = opposite ? 0.0f : state->yaw_residual_rad;
    state->rejected = true;
    state->turn.overrides_wheels = false;
    omni_pose_ekf_undo_gyro_turn(ekf, ekf_config, k, state->yaw_residual_rad, state->yaw_residual_s, doubt_rad);
    state->yaw_residual_rad = 0.0f;
    state->yaw_residual_s = 0.0f;
}

/* At the end of a window: has the gyro turned in the wheels' direction by 0.5 to 2 times as much? Some windows are
 * tolerated, as the wheels of a held or skidding robot turn alone. A gyro that has agreed before has no wrong sign or
 * scale, but may have failed: then it reads almost nothing. */
static void check_comparison_window(omni_gyro_state_t *state, omni_pose_ekf_state_t *ekf,
                                    const omni_pose_ekf_config_t *ekf_config, const omni_kinematics_t *k) {
    const bool proven = state->agreed_with_wheels > 0u;
    const bool full = state->wheel_turn_rad > state->window_rad;
    const bool alike = state->gyro_along_wheels_rad > 0.5f * state->wheel_turn_rad &&
                       state->gyro_along_wheels_rad < 2.0f * state->wheel_turn_rad;
    const bool right = full && alike;
    const bool wrong = full && !alike && (!proven || state->gyro_turn_rad < blind_fraction * state->wheel_turn_rad);
    const bool opposite = wrong && state->gyro_along_wheels_rad < -0.5f * state->wheel_turn_rad;
    const bool often = state->wrong_windows >= (omni_uint_t)(OMNI_GYRO_REJECT_WINDOWS - 1);
    const bool enough = wrong && (often || opposite);
    if (wrong && !enough) {
        state->wrong_windows = state->wrong_windows + 1u;
    }
    if ((full && !wrong) || enough) {
        state->wrong_windows = 0u;
    }
    state->agreed_with_wheels = right ? 1u : (enough ? 0u : state->agreed_with_wheels);
    if (state->rejected) {
        const bool close = state->gyro_along_wheels_rad > 0.8f * state->wheel_turn_rad &&
                           state->gyro_along_wheels_rad < 1.25f * state->wheel_turn_rad;
        state->rejected = !(full && close);
    } else if (enough) {
        reject_gyro(state, ekf, ekf_config, k, opposite);
    }
    if (full && !wrong) {
        state->yaw_residual_rad = 0.0f;
        state->yaw_residual_s = 0.0f;
    }
    const bool long_ones = state->agreed_with_wheels > 0u || state->rejected;
    if (full) {
        state->window_rad = long_ones ? later_window_rad : first_window_rad;
        state->wheel_turn_rad = 0.0f;
        state->gyro_along_wheels_rad = 0.0f;
        state->gyro_turn_rad = 0.0f;
    }
}

/* Only while motors drive: wheels turned by hand do not turn the body. */
static void compare_with_wheels(omni_gyro_state_t *state, const omni_gyro_tick_t *tick, omni_pose_ekf_state_t *ekf,
                                const omni_pose_ekf_config_t *ekf_config, const omni_kinematics_t *k) {
    const omni_real_t wheels_rad = tick->wheel_yaw_rate_rad_s * tick->duration_s;
    const omni_real_t gyro_rad = (state->rate_rad_s - omni_pose_ekf_bias(ekf)) * tick->duration_s;
    const bool compared = tick->motors_driven && omni_absf(tick->wheel_yaw_rate_rad_s) > min_compared_rate_rad_s;
    const bool followed = tick->motors_driven && state->turn.overrides_wheels;
    if (compared) {
        state->wheel_turn_rad += omni_absf(wheels_rad);
        state->gyro_along_wheels_rad += wheels_rad > 0.0f ? gyro_rad : -gyro_rad;
        state->gyro_turn_rad += omni_absf(gyro_rad);
    }
    if (followed) {
        state->yaw_residual_rad += gyro_rad - wheels_rad;
        state->yaw_residual_s += tick->duration_s;
    }
    check_comparison_window(state, ekf, ekf_config, k);
    if (followed) {
        state->second_wheel_turn_rad += wheels_rad;
        state->second_gyro_turn_rad += gyro_rad;
        state->second_x_m += tick->wheels_x_m_s * tick->duration_s;
        state->second_y_m += tick->wheels_y_m_s * tick->duration_s;
        state->second_s += tick->duration_s;
    }
}

/* Shift the bias by the difference of the gyro's and the wheels' rate in the last second. */
static void shift_bias(omni_gyro_state_t *state, omni_pose_ekf_state_t *ekf, const omni_pose_ekf_config_t *ekf_config,
                       const omni_kinematics_t *k) {
    const omni_real_t moved_rad_s = (state->second_gyro_turn_rad - state->second_wheel_turn_rad) / state->second_s;
    omni_ekf_gyro_calibration_t known;
    omni_pose_ekf_undo_gyro_turn(ekf, ekf_config, k, state->creep_rad, state->creep_s, state->creep_rad);
    omni_pose_ekf_get_gyro(ekf, &known);
    omni_pose_ekf_start_gyro(ekf, ekf_config);
    known.value[0] += moved_rad_s;
    known.p[0][0] = 0.0625f * moved_rad_s * moved_rad_s;
    known.p[0][1] = 0.0f;
    known.p[1][0] = 0.0f;
    omni_pose_ekf_set_gyro(ekf, &known);
    state->warning_ticks_left = OMNI_GYRO_WARNING_TICKS + 1u;
    state->creep_seconds = 0;
    state->yaw_residual_rad = 0.0f;
    state->yaw_residual_s = 0.0f;
}

/* At the end of each second: do the wheels turn the robot slowly and steadily on the spot, unseen by the gyro? That is
 * a robot that holds its heading with a stepped bias: see omni/gyro.h. */
static void check_bias_creep(omni_gyro_state_t *state, omni_pose_ekf_state_t *ekf,
                             const omni_pose_ekf_config_t *ekf_config, const omni_kinematics_t *k) {
    const omni_real_t turned = omni_absf(state->second_wheel_turn_rad);
    const bool slow =
        turned > min_creep_rate_rad_s * state->second_s && turned < max_creep_rate_rad_s * state->second_s;
    const bool unseen = omni_absf(state->second_gyro_turn_rad) < 0.25f * turned;
    const omni_real_t way_m = omni_absf(state->second_x_m) + omni_absf(state->second_y_m);
    const bool on_the_spot = way_m < 3.0f * turned * omni_absf(omni_lever_arm_m(k));
    const bool steady = omni_absf(state->second_wheel_turn_rad - state->previous_second_wheel_turn_rad) < 0.5f * turned;
    const bool creeps = slow && unseen && on_the_spot && steady;
    const omni_real_t apart_rad = state->second_gyro_turn_rad - state->second_wheel_turn_rad;
    state->creep_rad = creeps ? state->creep_rad + apart_rad : 0.0f;
    state->creep_s = creeps ? state->creep_s + state->second_s : 0.0f;
    state->creep_seconds = creeps ? state->creep_seconds + 1u : 0u;
    if (state->creep_seconds >= (omni_uint_t)OMNI_GYRO_CREEP_SECONDS) {
        shift_bias(state, ekf, ekf_config, k);
    }
    state->previous_second_wheel_turn_rad = state->second_wheel_turn_rad;
    state->second_wheel_turn_rad = 0.0f;
    state->second_gyro_turn_rad = 0.0f;
    state->second_x_m = 0.0f;
    state->second_y_m = 0.0f;
    state->second_s = 0.0f;
}

bool omni_gyro_step(omni_gyro_state_t *state, const omni_gyro_config_t *config, const omni_gyro_tick_t *tick,
                    omni_pose_ekf_state_t *ekf, const omni_pose_ekf_config_t *ekf_config, const omni_kinematics_t *k) {
    restart_gyro_if_reconfigured(state, config, tick, ekf, ekf_config);
    state->turn.overrides_wheels = false;
    state->turn.at_rest = false;
    state->turn.rate_rad_s = 0.0f;
    if (read_gyro(state, config, tick)) {
        state->turn.rate_rad_s = state->rate_rad_s;
        state->turn.at_rest = is_at_rest(state, tick, ekf, ekf_config);
        if (!state->ready && omni_pose_ekf_bias_variance(ekf) < 0.01f * ekf_config->p_bias) {
            state->ready = true;
        }
        if (state->ready) {
            state->turn.overrides_wheels = !state->turn.at_rest && !state->rejected;
            compare_with_wheels(state, tick, ekf, ekf_config, k);
        }
    } else {
        state->rest_ticks = 0;
    }
    if (tick->time_us >= state->second_end_us) {
        check_bias_creep(state, ekf, ekf_config, k);
        state->second_end_us = tick->time_us + hold_us;
    }
    state->warning_ticks_left = state->warning_ticks_left > 0u ? state->warning_ticks_left - 1u : 0u;
    return !state->faulty && !state->rejected && !(state->warning_ticks_left > 0u);
}
