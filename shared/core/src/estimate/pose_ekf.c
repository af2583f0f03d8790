/* SPDX-License-Identifier: MIT */
#include "omni/pose_ekf.h"

#include <string.h>

#include "pose_ekf_motion.h"

/* Limit of |error_state|. Beyond it a wheel spins or is blocked, which the slip model does not describe; and no working
 * gyro has such a bias [rad/s] or scale error. */
static const omni_real_t error_state_limit = 0.5f;

uint8_t omni_ekf_slips(const omni_pose_ekf_config_t *config, const omni_kinematics_t *k) {
    return config->mode == OMNI_EKF_MODE_SLIP ? k->wheels : 0;
}

void omni_ekf_restart_slips(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, uint8_t slip_states) {
    const int gyro = OMNI_AXES + OMNI_EKF_GYRO_BIAS; /* its calibration is kept */
    for (int a = OMNI_AXES; a < OMNI_EKF_STATES; ++a) {
        for (int b = 0; b < (a < gyro ? OMNI_EKF_STATES : gyro); ++b) {
            state->p[a][b] = 0.0f;
            state->p[b][a] = 0.0f;
        }
    }
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        state->error_state[i] = 0.0f;
        state->mean_slip[i] = 0.0f;
        state->mean_slip_distance_m[i] = 0.0f;
        state->p[OMNI_AXES + i][OMNI_AXES + i] = i < slip_states ? config->p_slip : 0.0f;
    }
}

void omni_ekf_restart_noise(omni_pose_ekf_state_t *state) {
    state->noise_factor = 1.0f;
    state->slip_noise_factor = 1.0f;
    state->fix_noise_factor = 1.0f;
    memset(state->whitened_innovation_sum, 0, sizeof state->whitened_innovation_sum);
}

void omni_pose_ekf_reset(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, const omni_pose_t *pose,
                         omni_real_t sd_xy, omni_real_t sd_theta) {
    memset(state, 0, sizeof *state);
    state->pose = *pose;
    state->pose.theta = omni_wrap_pi(pose->theta);
    state->p[0][0] = sd_xy * sd_xy;
    state->p[1][1] = sd_xy * sd_xy;
    state->p[2][2] = sd_theta * sd_theta;
    state->mode = OMNI_EKF_MODE_POSE;
    if (config->mode != OMNI_EKF_MODE_SLIP) {
        state->mode = config->mode;
    }
    omni_ekf_restart_noise(state);
    state->pose_noise_factor = 1.0f;
    omni_sincosf(state->pose.theta, &state->slot_sine, &state->slot_cosine);
}

void omni_pose_ekf_set_pose(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, const omni_pose_t *pose,
                            uint64_t time_us) {
    omni_pose_ekf_reset(state, config, pose, omni_sqrtf(config->r_xy), omni_sqrtf(config->r_theta));
    state->time_us = time_us;
    state->last_absolute_update_us = time_us;
}

void omni_ekf_apply_correction(omni_pose_ekf_state_t *state, const omni_real_t *delta, uint8_t error_states) {
    move_pose(state, delta);
    for (uint8_t i = 0; i < error_states; ++i) {
        state->error_state[i] =
            omni_clampf(state->error_state[i] + delta[OMNI_AXES + i], -error_state_limit, error_state_limit);
    }
    omni_ekf_history_rebase(state, error_states);
}

void omni_ekf_propagate_covariance(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                   const omni_kinematics_t *k, uint8_t slip_states, uint8_t error_states) {
    if (state->unpropagated_ticks == 0) {
        return;
    }
    if (error_states == OMNI_EKF_ERROR_STATES) {
        omni_ekf_propagate_covariance_gyro(state, config, k, slip_states);
    } else if (error_states == 3) {
        propagate_covariance(state, config, k, 3, 3);
    } else if (error_states == 0) {
        propagate_covariance(state, config, k, 0, 0);
    } else {
        propagate_covariance(state, config, k, 4, 4);
    }
    if (state->slot_ticks < OMNI_EKF_SLOT_TICKS) {
        state->last_propagated_slot = state->history[state->open_slot];
    }
}

void omni_pose_ekf_propagate_covariance(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                        const omni_kinematics_t *k) {
    omni_ekf_propagate_covariance(state, config, k, omni_ekf_slips(config, k), omni_ekf_error_states(config, k));
}

void omni_ekf_reconfigure_states(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                 const omni_kinematics_t *k, uint8_t error_states) {
    const uint8_t slips_before = state->mode == OMNI_EKF_MODE_SLIP ? k->wheels : 0;
    omni_ekf_propagate_covariance(state, config, k, slips_before, state->error_states);
    if (state->mode != config->mode) {
        omni_ekf_restart_slips(state, config, omni_ekf_slips(config, k));
        omni_ekf_history_rebase(state, 0);
        state->mode = config->mode;
    }
    state->error_states = error_states;
    if (state->slot_ticks > 0) {
        omni_ekf_history_next(state);
    }
}

void omni_pose_ekf_predict(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                           const omni_kinematics_t *k, const omni_real_t *wheel_delta_rad, uint64_t time_us) {
    predict_motion(state, config, k, wheel_delta_rad, NULL, time_us);
}
