/* SPDX-License-Identifier: MIT */
/* Covariance inflation and rollback on request of the floor odometry's supervision: see omni/pose_ekf.h. */
#include "../math/math_inline.h"
#include "pose_ekf_internal.h"

static const omni_real_t unknown_floor_slip_variance =
    0.3f * 0.3f; /* standard deviation of slip ratios over all floors: 0.3 */

void omni_pose_ekf_inflate_slip_covariance(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                           const omni_kinematics_t *k) {
    const uint8_t slip_states = omni_ekf_slips(config, k);
    omni_pose_ekf_propagate_covariance(state, config, k);
    for (uint8_t i = 0; i < slip_states; ++i) {
        for (int a = 0; a < OMNI_EKF_STATES; ++a) {
            state->p[a][OMNI_AXES + i] = 0.0f;
            state->p[OMNI_AXES + i][a] = 0.0f;
        }
        state->p[OMNI_AXES + i][OMNI_AXES + i] = omni_maxf(unknown_floor_slip_variance, config->p_slip);
    }
}

void omni_pose_ekf_undo_flow_updates(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                     const omni_kinematics_t *k, const omni_real_t *taken) {
    omni_real_t delta[OMNI_EKF_STATES] = {0.0f};
    omni_pose_ekf_propagate_covariance(state, config, k);
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        delta[axis] = -taken[axis];
        state->p[axis][axis] += taken[axis] * taken[axis];
    }
    omni_ekf_restart_slips(state, config, omni_ekf_slips(config, k));
    omni_ekf_apply_correction(state, delta, omni_ekf_error_states(config, k));
}
