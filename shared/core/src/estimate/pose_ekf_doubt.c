/* SPDX-License-Identifier: MIT */
/* What a sensor of motion over the floor makes the filter doubt: see omni/pose_ekf.h. */
#include "../math/math_inline.h"
#include "pose_ekf_internal.h"

static const omni_real_t flow_doubt = 0.3f * 0.3f; /* variance of a slip ratio on a floor that is not known */

void omni_pose_ekf_doubt_slips(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                               const omni_kinematics_t *k) {
    const uint8_t slips = omni_ekf_slips(config, k);
    omni_pose_ekf_settle(state, config, k);
    for (uint8_t i = 0; i < slips; ++i) {
        for (int a = 0; a < OMNI_EKF_STATES; ++a) {
            state->p[a][OMNI_AXES + i] = 0.0f;
            state->p[OMNI_AXES + i][a] = 0.0f;
        }
        state->p[OMNI_AXES + i][OMNI_AXES + i] = omni_select(flow_doubt > config->p_slip, flow_doubt, config->p_slip);
    }
}

void omni_pose_ekf_doubt_pose(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                              const omni_kinematics_t *k, const omni_real_t *doubt) {
    omni_pose_ekf_settle(state, config, k);
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        state->p[axis][axis] += doubt[axis] * doubt[axis];
    }
}

void omni_pose_ekf_take_back_flow(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                  const omni_kinematics_t *k, const omni_real_t *taken) {
    omni_real_t delta[OMNI_EKF_STATES] = {0.0f};
    omni_pose_ekf_settle(state, config, k);
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        delta[axis] = -taken[axis];
        state->p[axis][axis] += taken[axis] * taken[axis];
    }
    omni_ekf_restart_slips(state, config, omni_ekf_slips(config, k));
    omni_ekf_shift(state, delta, omni_ekf_columns(config, k));
}
