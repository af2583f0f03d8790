/* SPDX-License-Identifier: MIT */
/** @file pose_ekf_internal.h  Parts of the pose EKF that its files share. Not part of the API. */
#ifndef OMNI_POSE_EKF_INTERNAL_H
#define OMNI_POSE_EKF_INTERNAL_H

#include "omni/pose_ekf.h"

/** Variance of a uniformly distributed heading [rad^2]. A fix with a larger one does not measure the heading. */
#define OMNI_EKF_UNKNOWN_HEADING_VARIANCE (OMNI_PI_F * OMNI_PI_F / 3.0f)

/** Motion of one tick. */
typedef struct omni_ekf_motion_t {
    omni_real_t move[OMNI_AXES]; /**< dx, dy, dtheta; world frame */
    omni_real_t steps;           /**< elapsed time in nominal steps */
    omni_real_t slip_steps;      /**< the same times `slip_noise_factor` */
    omni_real_t noise_steps;     /**< the same times `pose_noise_factor` */
    omni_real_t turn_noise;      /**< variance added to theta, with a gyro */
    uint32_t duration_us;
} omni_ekf_motion_t;

/** Transition from the time of a fix t_f to now: x(t) = Phi x(t_f) + w with Phi = [[Phi_pose, gain], [0, I]], w ~ (0,
 * noise). */
typedef struct omni_ekf_window_t {
    omni_real_t move[OMNI_AXES];                            /**< world frame; Phi_pose = 1, -dy; 1, dx; 1 */
    omni_real_t jacobian[OMNI_AXES][OMNI_EKF_ERROR_STATES]; /**< Phi_ps */
    omni_real_t noise[OMNI_EKF_STATES][OMNI_EKF_STATES];    /**< W, upper triangle */
} omni_ekf_window_t;

/** Number of slip states in use: the wheel count in mode slip, else 0. */
uint8_t omni_ekf_slips(const omni_pose_ekf_config_t *config, const omni_kinematics_t *k);

/** Number of error states in use: the slip states, or all of them with a gyro. Those not in use are zero. */
static inline uint8_t omni_ekf_error_states(const omni_pose_ekf_config_t *config, const omni_kinematics_t *k) {
    return config->has_gyro ? (uint8_t)OMNI_EKF_ERROR_STATES : omni_ekf_slips(config, k);
}

/** A tick's noise is added after its motion. On average the noise of n ticks is transported by this fraction of their
 * motion: (n - 1) / 2n. @param ticks n; limited to OMNI_EKF_SLOT_TICKS. */
static inline omni_real_t omni_ekf_noise_motion_fraction(uint32_t ticks) {
    static const omni_real_t shares[OMNI_EKF_SLOT_TICKS + 1] = {0.0f, 0.0f, 0.25f, 1.0f / 3.0f, 0.375f};
    typedef char a_share_for_each_number_of_ticks[OMNI_EKF_SLOT_TICKS == 4 ? 1 : -1];
    (void)sizeof(a_share_for_each_number_of_ticks);
    return shares[ticks < OMNI_EKF_SLOT_TICKS ? ticks : OMNI_EKF_SLOT_TICKS];
}

/** Compute the open slot's Jacobian and propagate `p` to now. @param slip_states, error_states in use in the slot. */
void omni_ekf_propagate_covariance(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                   const omni_kinematics_t *k, uint8_t slip_states, uint8_t error_states);

/** omni_ekf_propagate_covariance for robots with a gyro. */
void omni_ekf_propagate_covariance_gyro(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                        const omni_kinematics_t *k, uint8_t slip_states);

/** Change the number of error states or the mode. Ends the open slot; a changed mode restarts the slip ratios. */
void omni_ekf_reconfigure_states(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                 const omni_kinematics_t *k, uint8_t error_states);

/** Reset slip ratios, their means and covariances to 0, and the variances of those in use to p_slip. */
void omni_ekf_restart_slips(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, uint8_t slip_states);

/** Reset the adapted noise factors to 1. */
void omni_ekf_restart_noise(omni_pose_ekf_state_t *state);

/** No fix was used and no pose set for OMNI_EKF_DEAD_RECKONING_AFTER_US. */
static inline bool omni_ekf_is_dead_reckoning(uint64_t last_absolute_update_us, uint64_t now_us) {
    return now_us > last_absolute_update_us && now_us - last_absolute_update_us > OMNI_EKF_DEAD_RECKONING_AFTER_US;
}

/** A fix has been used, and the filter is not in dead reckoning. */
static inline bool omni_ekf_has_fixes(const omni_pose_ekf_state_t *state) {
    return state->last_fix_us != 0 && !omni_ekf_is_dead_reckoning(state->last_absolute_update_us, state->time_us);
}

/** At the end of a slot: update the means of the slip ratios, or revert the ratios to them. */
void omni_ekf_update_slip_means(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                uint8_t slip_states);

/** At the end of a slot: correct slip ratios or bias by the difference of the wheels' and the gyro's turn. */
void omni_ekf_correct_with_gyro(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                const omni_kinematics_t *k, uint8_t slip_states);

/** Add `pending_turn_noise` to the covariance now. */
void omni_ekf_add_pending_gyro_noise(omni_pose_ekf_state_t *state);

/** Add a correction of 3 + error_states components to the estimate: Kahan summation, heading wrapped, error states
 * limited. */
void omni_ekf_apply_correction(omni_pose_ekf_state_t *state, const omni_real_t *delta, uint8_t error_states);

/** Add a tick to the open slot. @return true if that completes the slot; then call omni_ekf_history_next. */
bool omni_ekf_history_add(omni_pose_ekf_state_t *state, const omni_ekf_motion_t *motion, bool has_gyro);

/** Open the next slot at the current estimate. */
void omni_ekf_history_next(omni_pose_ekf_state_t *state);

/** Relinearise the open slot after a correction: same wheel motion, corrected heading and error states. `p` must have
 * been propagated. */
void omni_ekf_history_rebase(omni_pose_ekf_state_t *state, uint8_t error_states);

/** Motion and noise of the last age_us. @return false if the history does not reach back that far. */
bool omni_ekf_history_window(const omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                             const omni_kinematics_t *k, uint32_t age_us, omni_ekf_window_t *window);

/** omni_ekf_history_window with all error states: for a gyro or floor odometry. Unused slip ratios have no effect. */
bool omni_ekf_history_window_full(const omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                  const omni_kinematics_t *k, uint32_t age_us, omni_ekf_window_t *window);

#endif
