/* SPDX-License-Identifier: MIT */
#include "omni/flow.h"

#include <string.h>

#include "../math/math_inline.h"
#include "../model/kinematics_inline.h"

/* "Figures" are those of bench/figures/flow.py; the others are assumptions, with what they rest on. */

/* 4 m/s, faster than any robot here, over the pose EKF's history of 256 ms; half a turn in that time. */
static const omni_real_t flow_max_reading_m = 1.0f;
static const omni_real_t flow_max_reading_rad = OMNI_PI_F;
/* A sensor that works has reported 60 steps of 0.3 mm (an OTOS) by then. */
static const omni_real_t flow_stuck_at_zero_m = 0.02f;
/* Distance of a reading that shows the sensor's quality: 0.05 m/s at 50 Hz, and four standard deviations, which noise
 * exceeds once in 16 000 readings. */
static const omni_real_t flow_informative_m = 0.001f;
static const omni_real_t flow_informative_sds = 4.0f;
/* Three times as far: the direction of such a reading is known to 1/12 rad. */
static const omni_real_t flow_override_sds = 12.0f;
/* Gate while the wheels may still spin. Figures: with 1, the heading's NEES on ice is 14 instead of 4. */
static const omni_real_t flow_overriding_gate_factor = 0.25f;
/* Two steps of 0.3 mm within a reading at 50 Hz, as a speed. */
static const omni_real_t flow_speed_quantisation_m_s = 0.03f;
/* Wheels that spin on ice for longer do move the body. */
static const omni_real_t flow_unseen_distance_m = 0.1f;
/* Turn or length beyond this fraction of the residual is a spinning wheel's, which has 0.5. */
static const omni_real_t flow_misaligned_fraction = 0.25f;
/* Turn at a wheel, as a fraction of the distance: one wheel of three slips by 45 %. */
static const omni_real_t flow_spin_fraction = 0.15f;
/* A change of the wheels' motion that a sensor must show: four standard deviations as for flow_informative_m, and ten
 * times the sensor's noise of 1 % (FLOW_SHARE). */
static const omni_real_t flow_stuck_difference_m = 0.001f;
static const omni_real_t flow_stuck_difference_fraction = 0.1f;
/* Over about 50 readings, a second of an OTOS; more than half of them is "most". */
static const omni_real_t flow_rejection_filter_gain = 0.02f;
static const omni_real_t flow_max_rejection_rate = 0.5f;
/* Length of the least-squares window: a few changes of direction indoors. A quarter of it must be filled. */
static const omni_real_t flow_window_m = 2.0f;
static const omni_real_t flow_min_alignment_distance_m = 0.5f;
/* det / trace^2 of the moments: 0.25 for motion in all directions, 0.05 for two directions 27 degrees apart. */
static const omni_real_t flow_min_direction_spread = 0.05f;
/* Reading over the wheels' distance: slip ratios of -0.5, the largest, give 1.5. */
static const omni_real_t flow_max_length_ratio = 2.0f;
/* Three times psi's deviation of 0.05 rad under slip ratios to 30 % (docs/concepts/derivations/floor_motion.md);
 * the readings' noise may add a quarter of it. Back below half of it: hysteresis. */
static const omni_real_t flow_misalignment_rad = 0.15f;
static const omni_real_t flow_max_misalignment_sd_rad = 0.04f;
static const omni_real_t flow_aligned_rad = 0.075f;
/* Spinning wheels may be in the sums if this much of the window overrode them: five standard deviations of psi. */
static const omni_real_t flow_overriding_misalignment_rad = 0.25f;
static const omni_real_t flow_override_distance_m = 0.1f;
/* A hundred ticks: no late tick lasts as long, so the sensor has been off. */
static const uint64_t flow_restart_gap_us = 100000;
static const uint64_t flow_timeout_us = (uint64_t)OMNI_FLOW_TIMEOUT_TICKS * 1000u;

/* Compare members, not memory: padding may differ. */
static bool has_same_flow_config(const omni_flow_config_t *a, const omni_flow_config_t *b) {
    return a->axes == b->axes && a->delay_us == b->delay_us && a->mount_cosine == b->mount_cosine &&
           a->mount_sine == b->mount_sine && a->scale == b->scale && a->lever_arm_m[0] == b->lever_arm_m[0] &&
           a->lever_arm_m[1] == b->lever_arm_m[1];
}

/* A new or reconfigured sensor must qualify again. */
static void restart_flow_if_reconfigured(omni_flow_state_t *state, const omni_flow_config_t *config,
                                         const omni_flow_tick_t *tick) {
    const bool paused = tick->time_us > state->time_us && tick->time_us - state->time_us > flow_restart_gap_us;
    if (paused || !has_same_flow_config(&state->config, config)) {
        memset(state, 0, sizeof *state);
        state->last_valid_us = tick->time_us;
    }
    state->config = *config;
    state->time_us = tick->time_us;
}

/* Rotate the reading to body axes. */
static void rotate_reading_to_body(const omni_flow_config_t *config, const omni_real_t *reading,
                                   omni_ekf_flow_t *flow) {
    flow->move[0] = config->scale * (config->mount_cosine * reading[0] - config->mount_sine * reading[1]);
    flow->move[1] = config->scale * (config->mount_sine * reading[0] + config->mount_cosine * reading[1]);
    flow->move[2] = flow->measures_turn ? reading[2] : 0.0f;
    flow->lever_arm_m[0] = config->lever_arm_m[0];
    flow->lever_arm_m[1] = config->lever_arm_m[1];
    flow->r_xy = config->r_xy + config->r_relative * (flow->move[0] * flow->move[0] + flow->move[1] * flow->move[1]);
    flow->r_turn = config->r_turn;
}

static bool is_plausible_reading(const omni_ekf_flow_t *flow) {
    const omni_real_t far = omni_absf(flow->move[0]) + omni_absf(flow->move[1]);
    return far < flow_max_reading_m && omni_absf(flow->move[2]) < flow_max_reading_rad; /* false for NaN */
}

/* Distance by the wheels while the readings are zero. A flickering count does not add up. */
static omni_real_t zero_reading_distance_m(const omni_flow_state_t *state) {
    return omni_sqrtf(state->zero_reading_m[0] * state->zero_reading_m[0] +
                      state->zero_reading_m[1] * state->zero_reading_m[1]);
}

/* Does it repeat its last reading while the wheels' motion changes? Must run before the slip ratios adapt to it. */
static void detect_stuck_reading(omni_flow_state_t *state, const omni_real_t *reading,
                                 const omni_ekf_flow_result_t *result) {
    const bool zero = reading[0] == 0.0f && reading[1] == 0.0f;
    const bool same = reading[0] == state->last_reading[0] && reading[1] == state->last_reading[1] && !zero;
    omni_real_t way = 0.0f;
    omni_real_t change = 0.0f;
    for (int axis = 0; axis < 2; ++axis) {
        state->last_reading[axis] = reading[axis];
        if (!same) {
            state->wheels_at_first_repeat_m[axis] = result->no_slip[axis];
        }
        way += omni_absf(state->wheels_at_first_repeat_m[axis]);
        change += omni_absf(result->no_slip[axis] - state->wheels_at_first_repeat_m[axis]);
    }
    state->repeated_readings = same ? state->repeated_readings + 1u : 0u;
    const bool other = change > flow_stuck_difference_m + flow_stuck_difference_fraction * way;
    state->stuck = same && (state->stuck || (state->repeated_readings >= (uint32_t)OMNI_FLOW_STUCK_AFTER && other));
}

/* Factor by which sums over the last flow_window_m decay with a reading. */
static omni_real_t decay_factor(omni_real_t way_m) {
    const omni_real_t left = 1.0f - way_m / flow_window_m;
    return omni_maxf(left, 0.0f);
}

/* Accumulate the pose correction by the readings relative to wheels without slip. A fix resets it. */
static void accumulate_correction(omni_flow_state_t *state, const omni_ekf_flow_result_t *result, bool counts,
                                  const omni_pose_ekf_state_t *ekf) {
    const omni_real_t kept = state->fixes == ekf->accepted ? decay_factor(result->predicted_m) : 0.0f;
    omni_real_t more[OMNI_AXES];
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        more[axis] = (counts ? result->measured[axis] : result->predicted[axis]) - result->no_slip[axis];
    }
    omni_real_t sine;
    omni_real_t cosine;
    omni_sincosf(ekf->pose.theta, &sine, &cosine);
    state->accumulated_correction[0] = kept * state->accumulated_correction[0] + cosine * more[0] - sine * more[1];
    state->accumulated_correction[1] = kept * state->accumulated_correction[1] + sine * more[0] + cosine * more[1];
    state->accumulated_correction[2] = kept * state->accumulated_correction[2] + more[2];
    state->fixes = ekf->accepted;
}

/* Is a distance (squared) long enough, and beyond the sensor's noise, to say anything of its quality? */
static bool is_informative_distance(const omni_flow_state_t *state, omni_real_t way2) {
    return way2 > flow_informative_m * flow_informative_m &&
           way2 > flow_informative_sds * flow_informative_sds * state->config.r_xy;
}

/* Is the change of speed within OMNI_FLOW_MAX_ACCELERATION_M_S2? Also stores the speed for the next reading. */
static bool is_plausible_acceleration(omni_flow_state_t *state, const omni_ekf_flow_t *flow, uint64_t time_us) {
    const uint64_t since_us = time_us - state->last_plausible_us;
    const omni_real_t since_s = (omni_real_t)(since_us < flow_timeout_us ? since_us : flow_timeout_us) * 1e-6f;
    const omni_real_t most = (omni_real_t)OMNI_FLOW_MAX_ACCELERATION_M_S2 * since_s + flow_speed_quantisation_m_s;
    const omni_real_t span_s = (omni_real_t)flow->span_us * 1e-6f;
    omni_real_t sine;
    omni_real_t cosine;
    omni_sincosf(flow->move[2], &sine, &cosine);
    const omni_real_t before[2] = {cosine * state->last_speed_m_s[0] + sine * state->last_speed_m_s[1],
                                   cosine * state->last_speed_m_s[1] - sine * state->last_speed_m_s[0]};
    omni_real_t change2 = 0.0f;
    for (int axis = 0; axis < 2; ++axis) {
        const omni_real_t pace = flow->move[axis] / span_s;
        change2 += (pace - before[axis]) * (pace - before[axis]);
        state->last_speed_m_s[axis] = pace;
    }
    state->last_plausible_us = time_us;
    return change2 < most * most;
}

/* Does it report standstill along an axis along which the wheels move? */
static bool reports_standstill(const omni_flow_state_t *state) {
    return omni_absf(state->unseen_distance_m[0]) > flow_unseen_distance_m ||
           omni_absf(state->unseen_distance_m[1]) > flow_unseen_distance_m;
}

/* May it override the wheels? Never against pose fixes. */
static bool may_override(omni_flow_state_t *state, const omni_ekf_flow_t *flow, uint64_t time_us,
                         const omni_pose_ekf_state_t *ekf) {
    const bool may_go_on =
        is_plausible_acceleration(state, flow, time_us) && state->override_count < (omni_uint_t)OMNI_FLOW_MAX_OVERRIDES;
    if (!may_go_on) {
        state->long_distance_fits = 0u;
    }
    return state->alignment_verified && state->long_distance_fits >= (omni_uint_t)OMNI_FLOW_OVERRIDE_AFTER &&
           !state->stuck && !state->misaligned && !reports_standstill(state) && ekf->consecutive_refusals == 0;
}

/* Does the residual look like a misaligned sensor: same turn and length, other direction? A wheel that spins or slides
 * changes the turn, at a wheel, by half as much as the displacement. If nothing measures the turn, only the length is
 * compared. @param d displacement by the wheels. @param turn_m turn residual times the lever arm. */
static bool resembles_misalignment(const omni_real_t *d, const omni_real_t *z, omni_real_t turn_m) {
    const omni_real_t apart_m = omni_sqrtf((z[0] - d[0]) * (z[0] - d[0]) + (z[1] - d[1]) * (z[1] - d[1]));
    const omni_real_t longer_m = omni_sqrtf(z[0] * z[0] + z[1] * z[1]) - omni_sqrtf(d[0] * d[0] + d[1] * d[1]);
    const omni_real_t most_m = flow_misaligned_fraction * apart_m;
    return omni_absf(turn_m) < most_m && omni_absf(longer_m) < most_m;
}

/* Is the residual due to a wheel that spins or slides, or to a misaligned sensor? @return may psi use this reading? */
static bool can_show_misalignment(omni_flow_state_t *state, const omni_ekf_flow_t *flow,
                                  const omni_ekf_flow_result_t *result, const omni_pose_ekf_state_t *ekf,
                                  const omni_pose_ekf_config_t *ekf_config, const omni_kinematics_t *k) {
    const omni_real_t slot_s = (omni_real_t)OMNI_EKF_SLOT_TICKS * ekf_config->step_s;
    const omni_real_t by_gyro =
        ekf_config->has_gyro ? ekf->yaw_residual_mean_rad * (omni_real_t)flow->span_us * 1e-6f / slot_s : 0.0f;
    const bool turns = flow->measures_turn && !ekf_config->has_gyro;
    const omni_real_t turn_m = omni_lever_arm_m(k) * (turns ? result->measured[2] - result->no_slip[2] : by_gyro);
    const omni_real_t *d = result->no_slip;
    const bool spins = turn_m * turn_m > flow_spin_fraction * flow_spin_fraction * (d[0] * d[0] + d[1] * d[1]);
    const omni_real_t known_m = omni_lever_arm_m(k) * (turns ? result->measured[2] - result->predicted[2] : by_gyro);
    const bool suspected = resembles_misalignment(d, result->measured, turn_m) ||
                           resembles_misalignment(result->predicted, result->measured, known_m);
    const bool turns_alike =
        omni_absf(turn_m) < flow_misaligned_fraction * result->residual_m; /* false for a spinning wheel */
    for (int axis = 0; axis < 2; ++axis) {
        const omni_real_t z = result->measured[axis];
        const bool nothing = z * z < flow_informative_sds * flow_informative_sds * state->config.r_xy;
        const omni_real_t more_m = turns_alike ? result->no_slip[axis] - z : 0.0f;
        state->unseen_distance_m[axis] = nothing ? state->unseen_distance_m[axis] + more_m : 0.0f;
    }
    const omni_real_t unclear_m = turns ? 0.0f : result->predicted_m;
    state->override_distance_m =
        decay_factor(result->predicted_m) * state->override_distance_m + (result->overrode_wheels ? unclear_m : 0.0f);
    const omni_uint_t more =
        result->overrode_wheels ? state->consecutive_misaligned + 1u : state->consecutive_misaligned;
    state->consecutive_misaligned = suspected || result->within_gate ? more : 0u;
    const bool often = state->consecutive_misaligned >= (omni_uint_t)OMNI_FLOW_MISALIGNED_AFTER;
    return result->overrode_wheels ? often : !spins;
}

/* Least-squares misalignment (see omni/flow.h). A reading that is far too long is left out. */
static void estimate_misalignment(omni_flow_state_t *state, const omni_ekf_flow_result_t *result, bool usable) {
    const omni_real_t *d = result->no_slip;
    const omni_real_t *z = result->measured;
    const omni_real_t d2 = d[0] * d[0] + d[1] * d[1];
    const omni_real_t z2 = z[0] * z[0] + z[1] * z[1];
    omni_real_t *dd = state->wheel_moments_m2;
    if (usable && is_informative_distance(state, d2) && z2 < flow_max_length_ratio * flow_max_length_ratio * d2) {
        const omni_real_t distance_m = omni_sqrtf(d2);
        const omni_real_t kept = decay_factor(distance_m);
        state->alignment_distance_m = kept * state->alignment_distance_m + distance_m;
        dd[0] = kept * dd[0] + d[0] * d[0];
        dd[1] = kept * dd[1] + d[0] * d[1];
        dd[2] = kept * dd[2] + d[1] * d[1];
        for (int row = 0; row < 2; ++row) {
            for (int column = 0; column < 2; ++column) {
                state->cross_moments_m2[row][column] = kept * state->cross_moments_m2[row][column] + z[row] * d[column];
            }
        }
    }
    const omni_real_t(*zd)[2] = (const omni_real_t(*)[2])state->cross_moments_m2;
    const omni_real_t sum = dd[0] + dd[2];
    const omni_real_t spread = dd[0] * dd[2] - dd[1] * dd[1];
    const bool sure = result->residual_variance_m2 * sum <
                      4.0f * flow_max_misalignment_sd_rad * flow_max_misalignment_sd_rad * spread;
    state->direction_known = state->alignment_distance_m > flow_min_alignment_distance_m &&
                             spread > flow_min_direction_spread * sum * sum && sure;
    const omni_real_t turned = zd[1][0] * dd[2] - zd[1][1] * dd[1] + zd[0][0] * dd[1] - zd[0][1] * dd[0];
    const omni_real_t along = zd[0][0] * dd[2] - zd[0][1] * dd[1] - zd[1][0] * dd[1] + zd[1][1] * dd[0];
    state->misalignment_rad = state->direction_known ? omni_atan2f(turned, along) : 0.0f;
}

/* Undo the corrections of a misaligned sensor, and of one that is rejected soon after its first use. Corrections by one
 * that was consistent for longer, is stuck, or overrides, are kept. */
static void check_misalignment(omni_flow_state_t *state, bool stays, omni_pose_ekf_state_t *ekf,
                               const omni_pose_ekf_config_t *ekf_config, const omni_kinematics_t *k) {
    const bool before = state->misaligned;
    const omni_real_t first = state->override_distance_m > flow_override_distance_m ? flow_overriding_misalignment_rad
                                                                                    : flow_misalignment_rad;
    const bool off = omni_absf(state->misalignment_rad) > (before ? flow_aligned_rad : first);
    state->misaligned = (state->direction_known && off) || (!state->direction_known && before);
    const bool refused = state->consecutive_refusals == (omni_uint_t)OMNI_FLOW_FAULT_AFTER && !stays;
    const bool wrong = (state->misaligned && !before) || (refused && state->used_distance_m < flow_window_m);
    if (wrong && state->used_distance_m > 0.0f) {
        omni_pose_ekf_undo_flow_updates(ekf, ekf_config, k, state->accumulated_correction);
        memset(state->accumulated_correction, 0, sizeof state->accumulated_correction);
        state->used_distance_m = 0.0f;
    }
}

/* Are misfits due to a changed floor, so that the slip covariance is to be inflated? Slip changes the length, not the
 * direction. Due once, and every OMNI_FLOW_INFLATE_PERIOD readings. */
static bool floor_may_have_changed(const omni_flow_state_t *state, const omni_ekf_flow_result_t *result) {
    const bool slips = result->residual_m < 0.5f * result->predicted_m;
    const bool right = state->direction_known && omni_absf(state->misalignment_rad) < flow_aligned_rad;
    const bool due =
        state->consecutive_misfits % (omni_uint_t)OMNI_FLOW_INFLATE_PERIOD == (omni_uint_t)OMNI_FLOW_INFLATE_AFTER;
    return due && slips && !state->misaligned && (state->readings_used > 0u || right);
}

/* Update counters, fault, qualification and override from one reading. */
static void update_qualification(omni_flow_state_t *state, const omni_ekf_flow_result_t *result,
                                 omni_pose_ekf_state_t *ekf, const omni_pose_ekf_config_t *ekf_config,
                                 const omni_kinematics_t *k) {
    const bool fits = result->within_gate;
    const bool refused = !fits && !result->overrode_wheels;
    state->consecutive_misfits = fits ? 0u : state->consecutive_misfits + 1u;
    state->consecutive_refusals =
        refused ? state->consecutive_refusals + 1u : (fits ? 0u : state->consecutive_refusals);
    if (refused) {
        state->readings_rejected = state->readings_rejected + 1u;
    }
    const bool hangs = zero_reading_distance_m(state) > flow_stuck_at_zero_m || state->stuck;
    check_misalignment(state, hangs || result->overrode_wheels, ekf, ekf_config, k);
    const bool moves = is_informative_distance(state, result->predicted_m * result->predicted_m);
    const bool proves = fits && !hangs && !state->misaligned;
    state->consecutive_fits = proves ? (moves ? state->consecutive_fits + 1u : state->consecutive_fits) : 0u;
    const omni_real_t far_m2 = flow_override_sds * flow_override_sds * state->config.r_xy;
    const bool far = result->predicted_m * result->predicted_m > far_m2;
    if (proves && far) {
        state->long_distance_fits = state->long_distance_fits + 1u;
    }
    if (floor_may_have_changed(state, result)) {
        omni_pose_ekf_inflate_slip_covariance(ekf, ekf_config, k);
    }
    const omni_real_t share = state->rejection_rate;
    state->rejection_rate = share + flow_rejection_filter_gain * ((refused ? 1.0f : 0.0f) - share);
    const bool proved = state->consecutive_fits >= (uint32_t)OMNI_FLOW_QUALIFY_AFTER;
    const bool too_many = state->consecutive_refusals >= (uint32_t)OMNI_FLOW_FAULT_AFTER;
    const bool failed = hangs || state->misaligned || too_many || state->rejection_rate > flow_max_rejection_rate;
    const bool over = state->faulty && proved && !failed;
    if (over) {
        state->rejection_rate = 0.0f;
    }
    state->faulty = failed || (state->faulty && !proved);
    state->qualified = !state->faulty && (state->qualified || proved);
    if (!(state->qualified)) {
        state->long_distance_fits = 0u;
    }
    const bool straight = state->direction_known && omni_absf(state->misalignment_rad) < flow_aligned_rad;
    state->alignment_verified = state->qualified && (state->alignment_verified || straight);
    state->overriding = result->overrode_wheels || (state->overriding && !refused && !proved);
    const omni_uint_t fewer = fits && state->override_count > 0u ? state->override_count - 1u : state->override_count;
    state->override_count = result->overrode_wheels ? state->override_count + 1u : fewer;
    if (state->faulty || ekf->consecutive_refusals > 0) { /* the override was wrong */
        state->override_count = 0u;
        state->overriding = false;
        state->long_distance_fits = 0u;
    }
}

static void use_reading(omni_flow_state_t *state, const omni_flow_config_t *config, const omni_flow_tick_t *tick,
                        uint64_t since_us, omni_pose_ekf_state_t *ekf, const omni_pose_ekf_config_t *ekf_config,
                        const omni_kinematics_t *k) {
    omni_ekf_flow_t flow;
    omni_ekf_flow_result_t result;
    const uint64_t span_us = tick->time_us - since_us;
    if (since_us == 0 || span_us == 0 || span_us > flow_timeout_us || !tick->interval_valid) {
        return; /* the measured interval is unknown or beyond the history */
    }
    flow.measures_turn = config->axes > 2 && (tick->valid & (uint32_t)OMNI_FLOW_TURN) != 0u;
    flow.age_us = config->delay_us;
    flow.span_us = (uint32_t)span_us;
    rotate_reading_to_body(config, tick->reading, &flow);
    if (!is_plausible_reading(&flow)) {
        state->consecutive_fits = 0u;
        state->readings_rejected = state->readings_rejected + 1u;
        return;
    }
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        state->sum[axis] += flow.move[axis];
    }
    const bool zero = tick->reading[0] == 0.0f && tick->reading[1] == 0.0f;
    flow.apply = state->qualified;
    const omni_real_t gate = (state->overriding ? flow_overriding_gate_factor : 1.0f) * ekf_config->flow_gate;
    flow.override_nis = may_override(state, &flow, tick->time_us, ekf) ? gate : 0.0f;
    if (!omni_pose_ekf_correct_flow(ekf, ekf_config, k, &flow, &result)) {
        return; /* the estimate was restarted within the interval */
    }
    state->nis = result.nis;
    for (int axis = 0; axis < 2; ++axis) {
        state->zero_reading_m[axis] = zero ? state->zero_reading_m[axis] + result.no_slip[axis] : 0.0f;
    }
    estimate_misalignment(state, &result, can_show_misalignment(state, &flow, &result, ekf, ekf_config, k));
    const bool counted = flow.apply && (result.within_gate || result.overrode_wheels);
    accumulate_correction(state, &result, counted, ekf);
    detect_stuck_reading(state, tick->reading, &result);
    const bool fixed = ekf->last_fix_taken_us + flow.age_us + flow.span_us > ekf->time_us;
    if (!fixed ||
        (result.within_gate || flow.override_nis == 0.0f)) { /* it would override, but a fix lies within its interval */
        update_qualification(state, &result, ekf, ekf_config, k);
    }
    if (counted) {
        state->readings_used = state->readings_used + 1u;
        state->used_distance_m += result.predicted_m;
    }
    state->last_valid_us = tick->time_us;
    state->timed_out = false;
}

bool omni_flow_step(omni_flow_state_t *state, const omni_flow_config_t *config, const omni_flow_tick_t *tick,
                    omni_pose_ekf_state_t *ekf, const omni_pose_ekf_config_t *ekf_config, const omni_kinematics_t *k) {
    restart_flow_if_reconfigured(state, config, tick);
    if ((tick->valid & (uint32_t)OMNI_FLOW_RECEIVED) != 0u) {
        const uint64_t since_us = state->last_received_us;
        state->last_received_us = tick->time_us;
        const bool has_way = (tick->valid & (uint32_t)OMNI_FLOW_XY) == (uint32_t)OMNI_FLOW_XY;
        if (has_way) {
            use_reading(state, config, tick, since_us, ekf, ekf_config, k);
        }
        state->received = state->received + 1u;
        state->dropped = state->dropped + (has_way ? 0u : 1u);
    }
    if (tick->time_us > state->last_valid_us && tick->time_us - state->last_valid_us > flow_timeout_us) {
        state->consecutive_fits = 0u;
        state->timed_out = true;
        state->qualified = false;
    }
    return !state->faulty && !state->timed_out;
}
