/* SPDX-License-Identifier: MIT */
#include "omni/flow.h"

#include <string.h>

#include "../math/math_inline.h"
#include "../model/kinematics_inline.h"

static const omni_real_t flow_max_reading_m = 1.0f; /* 4 m/s over the length of the pose EKF's history */
static const omni_real_t flow_max_reading_rad = OMNI_PI_F;
static const omni_real_t flow_stuck_at_zero_m = 0.02f;
static const omni_real_t flow_informative_m = 0.001f;
static const omni_real_t flow_informative_sds = 4.0f;
static const omni_real_t flow_override_sds = 12.0f;
static const omni_real_t flow_overriding_gate_factor = 0.25f; /* tighter gate while the wheels may still spin */
static const omni_real_t flow_speed_quantisation_m_s = 0.03f; /* resolution of the sensor as a speed */
static const omni_real_t flow_unseen_distance_m = 0.1f;       /* spinning distance before a body on ice starts */
static const omni_real_t flow_misaligned_fraction = 0.25f;    /* of the residual */
static const omni_real_t flow_spin_fraction = 0.15f; /* of the distance, at a wheel: one wheel of three slips by 45 % */
static const omni_real_t flow_stuck_difference_m = 0.001f;
static const omni_real_t flow_stuck_difference_fraction = 0.1f;
static const omni_real_t flow_ignored_zero_m = 0.002f; /* a slow robot moves less than the sensor's resolution */
static const omni_real_t flow_rejection_filter_gain = 0.02f;
static const omni_real_t flow_max_rejection_rate = 0.5f;
static const omni_real_t flow_window_m = 2.0f; /* length of the least-squares window */
static const omni_real_t flow_min_alignment_distance_m = 0.5f;
static const omni_real_t flow_min_direction_spread = 0.05f;    /* det / trace^2 of the moments */
static const omni_real_t flow_max_length_ratio = 2.0f;         /* reading over the wheels' distance */
static const omni_real_t flow_max_misalignment_sd_rad = 0.04f; /* from the readings' noise */
static const omni_real_t flow_misalignment_rad = 0.15f;
static const omni_real_t flow_overriding_misalignment_rad = 0.25f; /* spinning wheels may be in the sums */
static const omni_real_t flow_override_distance_m = 0.1f;
static const omni_real_t flow_aligned_rad = 0.075f; /* below it a misaligned sensor is aligned again */
static const uint64_t flow_restart_gap_us = 100000; /* a longer gap between ticks: the sensor has been off */
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

static omni_flag_t is_plausible_reading(const omni_ekf_flow_t *flow) {
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
    const omni_flag_t zero = reading[0] == 0.0f && reading[1] == 0.0f;
    const omni_flag_t same = reading[0] == state->last_reading[0] && reading[1] == state->last_reading[1] && !zero;
    omni_real_t way = 0.0f;
    omni_real_t change = 0.0f;
    for (int axis = 0; axis < 2; ++axis) {
        state->last_reading[axis] = reading[axis];
        state->wheels_at_first_repeat_m[axis] =
            omni_select(same, state->wheels_at_first_repeat_m[axis], result->no_slip[axis]);
        way += omni_absf(state->wheels_at_first_repeat_m[axis]);
        change += omni_absf(result->no_slip[axis] - state->wheels_at_first_repeat_m[axis]);
    }
    state->repeated_readings = omni_select(same, state->repeated_readings + 1u, 0u);
    const omni_flag_t other = change > flow_stuck_difference_m + flow_stuck_difference_fraction * way;
    state->stuck = same && (state->stuck || (state->repeated_readings >= (uint32_t)OMNI_FLOW_STUCK_AFTER && other));
}

/* Factor by which sums over the last flow_window_m decay with a reading. */
static omni_real_t decay_factor(omni_real_t way_m) {
    const omni_real_t left = 1.0f - way_m / flow_window_m;
    return omni_select(left > 0.0f, left, 0.0f);
}

/* Accumulate the pose correction by the readings relative to wheels without slip. A fix resets it. */
static void accumulate_correction(omni_flow_state_t *state, const omni_ekf_flow_result_t *result, omni_flag_t counts,
                                  const omni_pose_ekf_state_t *ekf) {
    const omni_real_t kept = omni_select(state->fixes == ekf->accepted, decay_factor(result->predicted_m), 0.0f);
    omni_real_t more[OMNI_AXES];
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        more[axis] = omni_select(counts, result->measured[axis], result->predicted[axis]) - result->no_slip[axis];
    }
    omni_real_t sine;
    omni_real_t cosine;
    omni_sincosf(ekf->pose.theta, &sine, &cosine);
    const omni_real_t stays = omni_select(state->fixes == ekf->accepted && state->override_count > 0u, 1.0f, 0.0f);
    const omni_real_t leads = omni_select(result->overrode_wheels, 1.0f, 0.0f);
    state->override_displacement[0] =
        stays * state->override_displacement[0] + leads * (cosine * more[0] - sine * more[1]);
    state->override_displacement[1] =
        stays * state->override_displacement[1] + leads * (sine * more[0] + cosine * more[1]);
    state->override_displacement[2] = stays * state->override_displacement[2] + leads * more[2];
    state->accumulated_correction[0] = kept * state->accumulated_correction[0] + cosine * more[0] - sine * more[1];
    state->accumulated_correction[1] = kept * state->accumulated_correction[1] + sine * more[0] + cosine * more[1];
    state->accumulated_correction[2] = kept * state->accumulated_correction[2] + more[2];
    state->fixes = ekf->accepted;
}

/* Is a distance (squared) long enough, and beyond the sensor's noise, to say anything of its quality? */
static omni_flag_t is_informative_distance(const omni_flow_state_t *state, omni_real_t way2) {
    return way2 > flow_informative_m * flow_informative_m &&
           way2 > flow_informative_sds * flow_informative_sds * state->config.r_xy;
}

/* Is the change of speed within OMNI_FLOW_MAX_ACCELERATION_M_S2? Also stores the speed for the next reading. */
static omni_flag_t is_plausible_acceleration(omni_flow_state_t *state, const omni_ekf_flow_t *flow, uint64_t time_us) {
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
static omni_flag_t reports_standstill(const omni_flow_state_t *state) {
    return omni_absf(state->unseen_distance_m[0]) > flow_unseen_distance_m ||
           omni_absf(state->unseen_distance_m[1]) > flow_unseen_distance_m;
}

/* May it override the wheels? Never against pose fixes. */
static omni_flag_t may_override(omni_flow_state_t *state, const omni_ekf_flow_t *flow, uint64_t time_us,
                                const omni_pose_ekf_state_t *ekf) {
    const omni_flag_t may_go_on =
        is_plausible_acceleration(state, flow, time_us) && state->override_count < (omni_uint_t)OMNI_FLOW_MAX_OVERRIDES;
    state->long_distance_fits = omni_select(may_go_on, state->long_distance_fits, 0u);
    return state->alignment_verified && state->long_distance_fits >= (omni_uint_t)OMNI_FLOW_OVERRIDE_AFTER &&
           !state->stuck && !state->misaligned && !reports_standstill(state) && ekf->consecutive_refusals == 0;
}

/* If an override was wrong, add its displacement to the pose's deviation; the sensor must qualify again. */
static void end_override(omni_flow_state_t *state, omni_flag_t wrong, omni_pose_ekf_state_t *ekf,
                         const omni_pose_ekf_config_t *ekf_config, const omni_kinematics_t *k) {
    if (omni_any(wrong && state->override_count > 0u)) {
        omni_real_t doubt[OMNI_AXES];
        for (int axis = 0; axis < OMNI_AXES; ++axis) {
            doubt[axis] = omni_select(wrong, state->override_displacement[axis], 0.0f);
        }
        omni_pose_ekf_inflate_pose_covariance(ekf, ekf_config, k, doubt);
    }
    state->override_count = omni_select(wrong, 0u, state->override_count);
    state->overriding = state->overriding && !wrong;
    state->long_distance_fits = omni_select(wrong, 0u, state->long_distance_fits);
}

/* Does the residual look like a misaligned sensor: same turn and length, other direction? A wheel that spins or slides
 * changes the turn, at a wheel, by half as much as the displacement. If nothing measures the turn, only the length is
 * compared. @param d displacement by the wheels. @param turn_m turn residual times the lever arm. */
static omni_flag_t resembles_misalignment(const omni_real_t *d, const omni_real_t *z, omni_real_t turn_m) {
    const omni_real_t apart_m = omni_sqrtf((z[0] - d[0]) * (z[0] - d[0]) + (z[1] - d[1]) * (z[1] - d[1]));
    const omni_real_t longer_m = omni_sqrtf(z[0] * z[0] + z[1] * z[1]) - omni_sqrtf(d[0] * d[0] + d[1] * d[1]);
    const omni_real_t most_m = flow_misaligned_fraction * apart_m;
    return omni_absf(turn_m) < most_m && omni_absf(longer_m) < most_m;
}

/* Is the residual due to a wheel that spins or slides, or to a misaligned sensor? */
static void classify_residual(omni_flow_state_t *state, const omni_ekf_flow_t *flow,
                              const omni_ekf_flow_result_t *result, const omni_pose_ekf_state_t *ekf,
                              const omni_pose_ekf_config_t *ekf_config, const omni_kinematics_t *k) {
    const omni_real_t slot_s = (omni_real_t)OMNI_EKF_SLOT_TICKS * ekf_config->step_s;
    const omni_real_t by_gyro =
        ekf_config->has_gyro ? ekf->yaw_residual_mean_rad * (omni_real_t)flow->span_us * 1e-6f / slot_s : 0.0f;
    const bool turns = flow->measures_turn && !ekf_config->has_gyro;
    const omni_real_t turn_m = omni_lever_arm_m(k) * (turns ? result->measured[2] - result->no_slip[2] : by_gyro);
    const omni_real_t *d = result->no_slip;
    const omni_flag_t spins = turn_m * turn_m > flow_spin_fraction * flow_spin_fraction * (d[0] * d[0] + d[1] * d[1]);
    const omni_real_t known_m = omni_lever_arm_m(k) * (turns ? result->measured[2] - result->predicted[2] : by_gyro);
    state->misalignment_suspected = resembles_misalignment(d, result->measured, turn_m) ||
                                    resembles_misalignment(result->predicted, result->measured, known_m);
    const omni_flag_t turns_alike =
        omni_absf(turn_m) < flow_misaligned_fraction * result->residual_m; /* false for a spinning wheel */
    for (int axis = 0; axis < 2; ++axis) {
        const omni_real_t z = result->measured[axis];
        const omni_flag_t nothing = z * z < flow_informative_sds * flow_informative_sds * state->config.r_xy;
        const omni_real_t more_m = omni_select(turns_alike, result->no_slip[axis] - z, 0.0f);
        state->unseen_distance_m[axis] = omni_select(nothing, state->unseen_distance_m[axis] + more_m, 0.0f);
    }
    const omni_real_t unclear_m = turns ? 0.0f : result->predicted_m;
    state->override_distance_m = decay_factor(result->predicted_m) * state->override_distance_m +
                                 omni_select(result->overrode_wheels, unclear_m, 0.0f);
    const omni_uint_t more =
        omni_select(result->overrode_wheels, state->consecutive_misaligned + 1u, state->consecutive_misaligned);
    state->consecutive_misaligned = omni_select(state->misalignment_suspected || result->within_gate, more, 0u);
    const omni_flag_t often = state->consecutive_misaligned >= (omni_uint_t)OMNI_FLOW_MISALIGNED_AFTER;
    state->informative = (result->overrode_wheels && often) || (!result->overrode_wheels && !spins);
}

/* Least-squares misalignment (see omni/flow.h). A reading that is far too long is left out. */
static void estimate_misalignment(omni_flow_state_t *state, const omni_ekf_flow_result_t *result) {
    const omni_real_t *d = result->no_slip;
    const omni_real_t *z = result->measured;
    const omni_real_t d2 = d[0] * d[0] + d[1] * d[1];
    const omni_real_t z2 = z[0] * z[0] + z[1] * z[1];
    const omni_flag_t tells = is_informative_distance(state, d2) &&
                              z2 < flow_max_length_ratio * flow_max_length_ratio * d2 && state->informative;
    const omni_real_t way = omni_select(tells, omni_sqrtf(d2), 0.0f);
    const omni_real_t weight = omni_select(tells, 1.0f, 0.0f);
    const omni_real_t kept = decay_factor(way);
    state->alignment_distance_m = kept * state->alignment_distance_m + way;
    omni_real_t *dd = state->wheel_moments_m2;
    dd[0] = kept * dd[0] + weight * d[0] * d[0];
    dd[1] = kept * dd[1] + weight * d[0] * d[1];
    dd[2] = kept * dd[2] + weight * d[1] * d[1];
    for (int row = 0; row < 2; ++row) {
        for (int column = 0; column < 2; ++column) {
            const omni_real_t product = omni_select(tells, z[row] * d[column], 0.0f);
            state->cross_moments_m2[row][column] = kept * state->cross_moments_m2[row][column] + product;
        }
    }
    const omni_real_t(*zd)[2] = (const omni_real_t(*)[2])state->cross_moments_m2;
    const omni_real_t sum = dd[0] + dd[2];
    const omni_real_t spread = dd[0] * dd[2] - dd[1] * dd[1];
    const omni_flag_t sure = result->residual_variance_m2 * sum <
                             4.0f * flow_max_misalignment_sd_rad * flow_max_misalignment_sd_rad * spread;
    state->direction_known = state->alignment_distance_m > flow_min_alignment_distance_m &&
                             spread > flow_min_direction_spread * sum * sum && sure;
    const omni_real_t turned = zd[1][0] * dd[2] - zd[1][1] * dd[1] + zd[0][0] * dd[1] - zd[0][1] * dd[0];
    const omni_real_t along = zd[0][0] * dd[2] - zd[0][1] * dd[1] - zd[1][0] * dd[1] + zd[1][1] * dd[0];
    state->misalignment_rad = omni_select(state->direction_known, omni_atan2f(turned, along), 0.0f);
}

/* Undo the corrections of a misaligned sensor, and of one that is rejected soon after its first use. Corrections by one
 * that was consistent for longer, is stuck, or overrides, are kept. */
static void check_misalignment(omni_flow_state_t *state, omni_flag_t stays, omni_pose_ekf_state_t *ekf,
                               const omni_pose_ekf_config_t *ekf_config, const omni_kinematics_t *k) {
    const omni_flag_t before = state->misaligned;
    const omni_real_t first = omni_select(state->override_distance_m > flow_override_distance_m,
                                          flow_overriding_misalignment_rad, flow_misalignment_rad);
    const omni_flag_t off = omni_absf(state->misalignment_rad) > omni_select(before, flow_aligned_rad, first);
    state->misaligned = (state->direction_known && off) || (!state->direction_known && before);
    const omni_flag_t refused = state->consecutive_refusals == (omni_uint_t)OMNI_FLOW_FAULT_AFTER && !stays;
    const omni_flag_t wrong = (state->misaligned && !before) || (refused && state->used_distance_m < flow_window_m);
    if (wrong && state->used_distance_m > 0.0f) {
        omni_pose_ekf_undo_flow_updates(ekf, ekf_config, k, state->accumulated_correction);
        memset(state->accumulated_correction, 0, sizeof state->accumulated_correction);
        state->used_distance_m = 0.0f;
    }
}

/* Are misfits due to a changed floor, so that the slip covariance is to be inflated? Slip changes the length, not the
 * direction. Due once, and every OMNI_FLOW_INFLATE_PERIOD readings. */
static omni_flag_t floor_may_have_changed(const omni_flow_state_t *state, const omni_ekf_flow_result_t *result) {
    const omni_flag_t slips = result->residual_m < 0.5f * result->predicted_m;
    const omni_flag_t right = state->direction_known && omni_absf(state->misalignment_rad) < flow_aligned_rad;
    const omni_flag_t due =
        state->consecutive_misfits % (omni_uint_t)OMNI_FLOW_INFLATE_PERIOD == (omni_uint_t)OMNI_FLOW_INFLATE_AFTER;
    return due && slips && !state->misaligned && (state->readings_used > 0u || right);
}

/* Update counters, fault, qualification and override from one reading. */
static void update_qualification(omni_flow_state_t *state, const omni_ekf_flow_result_t *result,
                                 omni_pose_ekf_state_t *ekf, const omni_pose_ekf_config_t *ekf_config,
                                 const omni_kinematics_t *k) {
    const omni_flag_t fits = result->within_gate;
    const omni_flag_t refused = !fits && !result->overrode_wheels;
    state->consecutive_misfits = omni_select(fits, 0u, state->consecutive_misfits + 1u);
    state->consecutive_refusals =
        omni_select(refused, state->consecutive_refusals + 1u, omni_select(fits, 0u, state->consecutive_refusals));
    state->readings_rejected = omni_select(refused, state->readings_rejected + 1u, state->readings_rejected);
    const omni_flag_t hangs = zero_reading_distance_m(state) > flow_stuck_at_zero_m || state->stuck;
    check_misalignment(state, hangs || result->overrode_wheels, ekf, ekf_config, k);
    const omni_flag_t moves = is_informative_distance(state, result->predicted_m * result->predicted_m);
    const omni_flag_t proves = fits && !hangs && !state->misaligned;
    state->consecutive_fits =
        omni_select(proves, omni_select(moves, state->consecutive_fits + 1u, state->consecutive_fits), 0u);
    const omni_real_t far_m2 = flow_override_sds * flow_override_sds * state->config.r_xy;
    const omni_flag_t far = result->predicted_m * result->predicted_m > far_m2;
    state->long_distance_fits = omni_select(proves && far, state->long_distance_fits + 1u, state->long_distance_fits);
    if (floor_may_have_changed(state, result)) {
        omni_pose_ekf_inflate_slip_covariance(ekf, ekf_config, k);
    }
    const omni_real_t share = state->rejection_rate;
    state->rejection_rate = share + flow_rejection_filter_gain * (omni_select(refused, 1.0f, 0.0f) - share);
    const omni_flag_t proved = state->consecutive_fits >= (uint32_t)OMNI_FLOW_QUALIFY_AFTER;
    const omni_flag_t too_many = state->consecutive_refusals >= (uint32_t)OMNI_FLOW_FAULT_AFTER;
    const omni_flag_t failed =
        hangs || state->misaligned || too_many || state->rejection_rate > flow_max_rejection_rate;
    const omni_flag_t over = state->faulty && proved && !failed;
    state->rejection_rate = omni_select(over, 0.0f, state->rejection_rate);
    state->faulty = failed || (state->faulty && !proved);
    state->qualified = !state->faulty && (state->qualified || proved);
    state->long_distance_fits = omni_select(state->qualified, state->long_distance_fits, 0u);
    const omni_flag_t straight = state->direction_known && omni_absf(state->misalignment_rad) < flow_aligned_rad;
    state->alignment_verified = state->qualified && (state->alignment_verified || straight);
    state->overriding = result->overrode_wheels || (state->overriding && !refused && !proved);
    const omni_uint_t fewer =
        omni_select(fits && state->override_count > 0u, state->override_count - 1u, state->override_count);
    state->override_count = omni_select(result->overrode_wheels, state->override_count + 1u, fewer);
    end_override(state, state->faulty || ekf->consecutive_refusals > 0, ekf, ekf_config, k);
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
    const omni_flag_t zero = tick->reading[0] == 0.0f && tick->reading[1] == 0.0f;
    flow.apply = state->qualified && !(zero && zero_reading_distance_m(state) > flow_ignored_zero_m);
    const omni_real_t gate = omni_select(state->overriding, flow_overriding_gate_factor, 1.0f) * ekf_config->flow_gate;
    flow.override_nis = omni_select(may_override(state, &flow, tick->time_us, ekf), gate, 0.0f);
    if (!omni_pose_ekf_correct_flow(ekf, ekf_config, k, &flow, &result)) {
        return; /* the estimate was restarted within the interval */
    }
    state->nis = result.nis;
    for (int axis = 0; axis < 2; ++axis) {
        state->zero_reading_m[axis] = omni_select(zero, state->zero_reading_m[axis] + result.no_slip[axis], 0.0f);
    }
    classify_residual(state, &flow, &result, ekf, ekf_config, k);
    estimate_misalignment(state, &result);
    const omni_flag_t counted = flow.apply && (result.within_gate || result.overrode_wheels);
    accumulate_correction(state, &result, counted, ekf);
    detect_stuck_reading(state, tick->reading, &result);
    const bool fixed = ekf->last_fix_taken_us + flow.age_us + flow.span_us > ekf->time_us;
    if (!fixed || omni_any(result.within_gate ||
                           flow.override_nis == 0.0f)) { /* it would override, but a fix lies within its interval */
        update_qualification(state, &result, ekf, ekf_config, k);
    }
    state->readings_used = omni_select(counted, state->readings_used + 1u, state->readings_used);
    state->used_distance_m += omni_select(counted, result.predicted_m, 0.0f);
    state->last_valid_us = tick->time_us;
    state->timed_out = false;
}

omni_flag_t omni_flow_step(omni_flow_state_t *state, const omni_flow_config_t *config, const omni_flow_tick_t *tick,
                           omni_pose_ekf_state_t *ekf, const omni_pose_ekf_config_t *ekf_config,
                           const omni_kinematics_t *k) {
    restart_flow_if_reconfigured(state, config, tick);
    if ((tick->valid & (uint32_t)OMNI_FLOW_RECEIVED) != 0u) {
        const uint64_t since_us = state->last_received_us;
        state->last_received_us = tick->time_us;
        const bool has_way = (tick->valid & (uint32_t)OMNI_FLOW_XY) == (uint32_t)OMNI_FLOW_XY;
        if (has_way) {
            use_reading(state, config, tick, since_us, ekf, ekf_config, k);
        }
        state->received = state->received + 1u;
        state->dropped = state->dropped + omni_select(has_way, 0u, 1u);
    }
    if (tick->time_us > state->last_valid_us && tick->time_us - state->last_valid_us > flow_timeout_us) {
        state->consecutive_fits = 0u;
        state->timed_out = true;
        state->qualified = false;
    }
    return !state->faulty && !state->timed_out;
}
