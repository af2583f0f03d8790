/* SPDX-License-Identifier: MIT */
/** @file pose_ekf_internal.h  Parts of the pose EKF that its files share. Not part of the API. */
#ifndef OMNI_POSE_EKF_INTERNAL_H
#define OMNI_POSE_EKF_INTERNAL_H

#include "omni/pose_ekf.h"

/** Motion of one tick. */
typedef struct omni_ekf_motion_t {
    omni_real_t cosine; /**< of the heading at mid-tick */
    omni_real_t sine;
    omni_real_t move[OMNI_AXES];                  /**< dx, dy, dtheta; dx and dy in the mid-tick body frame */
    omni_real_t gain[OMNI_AXES][OMNI_MAX_WHEELS]; /**< d move / d s_i, in the same frame */
    omni_real_t noise[OMNI_MAX_WHEELS];           /**< variance added to each slip ratio */
    omni_real_t steps;                            /**< elapsed nominal steps */
    uint32_t duration_us;
} omni_ekf_motion_t;

/** From the time of a fix to now: x(now) = Phi x(then) + w with Phi = [[Phi_pose, gain], [0, I]], w ~ (0, noise). */
typedef struct omni_ekf_window_t {
    omni_real_t move[OMNI_AXES];                         /**< world frame; Phi_pose = 1, -dy; 1, dx; 1 */
    omni_real_t gain[OMNI_AXES][OMNI_MAX_WHEELS];        /**< Phi_ps */
    omni_real_t noise[OMNI_EKF_STATES][OMNI_EKF_STATES]; /**< W */
} omni_ekf_window_t;

/** Number of slip states in use: 0, or the wheel count in mode slip. */
uint8_t omni_ekf_slips(const omni_pose_ekf_config_t *config, const omni_kinematics_t *k);

/** Forget slip ratios and what the covariance says of them; start anew with p_slip if they are in use. */
void omni_ekf_restart_slips(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, uint8_t slips);

/** Add a correction of 3 + slips components to the estimate: compensated, heading wrapped, slip ratios limited. */
void omni_ekf_shift(omni_pose_ekf_state_t *state, const omni_real_t *delta, uint8_t slips);

/** Add a tick to the slot being filled. @return true if that completes the slot; then call omni_ekf_history_next. */
bool omni_ekf_history_add(omni_pose_ekf_state_t *state, const omni_ekf_motion_t *motion, uint8_t slips);

/** Open the next slot at the current estimate. */
void omni_ekf_history_next(omni_pose_ekf_state_t *state);

/** The open slot after a correction: same wheel motion, corrected heading and slip ratios. */
void omni_ekf_history_rebase(omni_pose_ekf_state_t *state, uint8_t slips);

/** Motion and noise of the last age_us. @return false if the history does not reach back that far. */
bool omni_ekf_history_window(const omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                             const omni_kinematics_t *k, uint32_t age_us, omni_ekf_window_t *window);

#endif
