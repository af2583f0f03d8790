/* SPDX-License-Identifier: MIT */
/**
 * @file pose_ekf_inline.h
 * Accessors of the pose EKF's covariance for the tick, inlined: see math_inline.h. Not part of the API.
 */
#ifndef OMNI_POSE_EKF_INLINE_H
#define OMNI_POSE_EKF_INLINE_H

#include "omni/pose_ekf.h"

/** Variance of one axis of the pose: m^2, m^2, rad^2. */
static inline omni_real_t omni_pose_ekf_variance(const omni_pose_ekf_state_t *state, int axis) {
    return state->p[axis][axis];
}

/** Bias of the gyro [rad/s], and its variance. */
static inline omni_real_t omni_pose_ekf_bias(const omni_pose_ekf_state_t *state) {
    return state->error_state[OMNI_EKF_GYRO_BIAS];
}

static inline omni_real_t omni_pose_ekf_bias_variance(const omni_pose_ekf_state_t *state) {
    return state->p[OMNI_AXES + OMNI_EKF_GYRO_BIAS][OMNI_AXES + OMNI_EKF_GYRO_BIAS];
}

/** Variance of sum row[i] s_i, the slip ratios weighted with `row`. @param wheels entries of `row`; mode slip only. */
static inline omni_real_t omni_pose_ekf_slip_variance(const omni_pose_ekf_state_t *state, const omni_real_t *row,
                                                      uint8_t wheels) {
    omni_real_t variance = 0.0f;
    for (uint8_t i = 0; i < wheels; ++i) {
        for (uint8_t j = 0; j < wheels; ++j) {
            variance += row[i] * state->p[OMNI_AXES + i][OMNI_AXES + j] * row[j];
        }
    }
    return variance;
}

#endif
