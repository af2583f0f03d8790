/* SPDX-License-Identifier: MIT */
/** @file pose_ekf_internal.h  Parts of the pose EKF that its files share. Not part of the API. */
#ifndef OMNI_POSE_EKF_INTERNAL_H
#define OMNI_POSE_EKF_INTERNAL_H

#include "omni/pose_ekf.h"

/** Variance of a heading that may be any [rad^2]. A fix with more says nothing of it. */
#define OMNI_EKF_ANY_HEADING (OMNI_PI_F * OMNI_PI_F / 3.0f)

/** Motion of one tick. */
typedef struct omni_ekf_motion_t {
    omni_real_t move[OMNI_AXES]; /**< dx, dy, dtheta; world frame */
    omni_real_t steps;           /**< elapsed nominal steps */
    omni_real_t slip_steps;      /**< times lambda */
    omni_real_t noise_steps;     /**< times the factor of q_xy and q_theta */
    omni_real_t turn_noise;      /**< variance added to theta, with a gyro */
    uint32_t duration_us;
} omni_ekf_motion_t;

/** From the time of a fix to now: x(now) = Phi x(then) + w with Phi = [[Phi_pose, gain], [0, I]], w ~ (0, noise). */
typedef struct omni_ekf_window_t {
    omni_real_t move[OMNI_AXES];                         /**< world frame; Phi_pose = 1, -dy; 1, dx; 1 */
    omni_real_t gain[OMNI_AXES][OMNI_EKF_COLUMNS];       /**< Phi_ps */
    omni_real_t noise[OMNI_EKF_STATES][OMNI_EKF_STATES]; /**< W, upper triangle */
} omni_ekf_window_t;

/** Number of slip states in use: 0, or the wheel count in mode slip. */
uint8_t omni_ekf_slips(const omni_pose_ekf_config_t *config, const omni_kinematics_t *k);

/** Number of states after the pose: the slip states, or all of them with a gyro. Those not in use are zero. */
static inline uint8_t omni_ekf_columns(const omni_pose_ekf_config_t *config, const omni_kinematics_t *k) {
    return config->gyro ? (uint8_t)OMNI_EKF_COLUMNS : omni_ekf_slips(config, k);
}

/** A tick's noise enters after its motion. In the mean the noise of n ticks sees this share of their motion: (n - 1) /
 * 2n. @param ticks n; more count as OMNI_EKF_SLOT_TICKS */
static inline omni_real_t omni_ekf_noise_share(uint32_t ticks) {
    static const omni_real_t shares[OMNI_EKF_SLOT_TICKS + 1] = {0.0f, 0.0f, 0.25f, 1.0f / 3.0f, 0.375f};
    typedef char a_share_for_each_number_of_ticks[OMNI_EKF_SLOT_TICKS == 4 ? 1 : -1];
    (void)sizeof(a_share_for_each_number_of_ticks);
    return shares[ticks < OMNI_EKF_SLOT_TICKS ? ticks : OMNI_EKF_SLOT_TICKS];
}

/** The open slot gets its gain, and `p` follows the motion up to now. @param slips, columns of the slot's ticks. */
void omni_ekf_settle(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, const omni_kinematics_t *k,
                     uint8_t slips, uint8_t columns);

/** The same with a gyro. */
void omni_ekf_settle_turn(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                          const omni_kinematics_t *k, uint8_t slips);

/** From this tick on there are other states after the pose. The open slot ends; another mode restarts slip ratios. */
void omni_ekf_change_states(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                            const omni_kinematics_t *k, uint8_t columns);

/** Forget slip ratios and what the covariance says of them; start anew with p_slip if they are in use. */
void omni_ekf_restart_slips(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, uint8_t slips);

/** Noise levels are those of the configuration again. */
void omni_ekf_restart_noise(omni_pose_ekf_state_t *state);

/** No fix was used, and no pose set, for so long that the wheels are on their own. */
static inline bool omni_ekf_is_alone(uint64_t told_us, uint64_t now_us) {
    return now_us > told_us && now_us - told_us > OMNI_EKF_ALONE_US;
}

/** Fixes are used: one at least, and the wheels are not on their own. */
static inline bool omni_ekf_has_fixes(const omni_pose_ekf_state_t *state) {
    return state->last_fix_us != 0 && !omni_ekf_is_alone(state->told_us, state->time_us);
}

/** The slot being filled is complete: means of the slip ratios learn, or the ratios return to them. */
void omni_ekf_follow_mean(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, uint8_t slips);

/** The slot being filled is complete: what wheels and gyro say of its turn corrects slip ratios and bias. */
void omni_ekf_use_turn(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, const omni_kinematics_t *k,
                       uint8_t slips);

/** All noise of theta goes into the covariance now. */
void omni_ekf_settle_turn_noise(omni_pose_ekf_state_t *state);

/** Add a correction of 3 + columns components to the estimate: compensated, heading wrapped, slip ratios and bias
 * limited. */
void omni_ekf_shift(omni_pose_ekf_state_t *state, const omni_real_t *delta, uint8_t columns);

/** Add a tick to the slot being filled. @return true if that completes the slot; then call omni_ekf_history_next. */
bool omni_ekf_history_add(omni_pose_ekf_state_t *state, const omni_ekf_motion_t *motion, bool has_gyro);

/** Open the next slot at the current estimate. */
void omni_ekf_history_next(omni_pose_ekf_state_t *state);

/** The open slot after a correction: same wheel motion, corrected heading and slip ratios. `p` is settled. */
void omni_ekf_history_rebase(omni_pose_ekf_state_t *state, uint8_t columns);

/** Motion and noise of the last age_us. @return false if the history does not reach back that far. */
bool omni_ekf_history_window(const omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                             const omni_kinematics_t *k, uint32_t age_us, omni_ekf_window_t *window);

/** The same with a gyro, or a sensor of motion over the floor. Slip ratios that are not in use change nothing. */
bool omni_ekf_turn_window(const omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                          const omni_kinematics_t *k, uint32_t age_us, omni_ekf_window_t *window);

#endif
