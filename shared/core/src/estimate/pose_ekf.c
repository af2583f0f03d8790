/* SPDX-License-Identifier: MIT */
#include "omni/pose_ekf.h"

#include <string.h>

#include "pose_ekf_motion.h"

/* A ratio beyond this is no slip any more: the wheel spins or is blocked, and the model says nothing. No gyro that
 * works has a bias of so many rad/s, or a scale so wrong. */
static const omni_real_t slip_limit = 0.5f;

uint8_t omni_ekf_slips(const omni_pose_ekf_config_t *config, const omni_kinematics_t *k) {
    return config->mode == OMNI_EKF_MODE_SLIP ? k->wheels : 0;
}

void omni_ekf_restart_slips(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, uint8_t slips) {
    const int gyro = OMNI_AXES + OMNI_EKF_BIAS; /* what is known of it stays */
    for (int a = OMNI_AXES; a < OMNI_EKF_STATES; ++a) {
        for (int b = 0; b < (a < gyro ? OMNI_EKF_STATES : gyro); ++b) {
            state->p[a][b] = 0.0f;
            state->p[b][a] = 0.0f;
        }
    }
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        state->slip[i] = 0.0f;
        state->mean_slip[i] = 0.0f;
        state->mean_way_m[i] = 0.0f;
        state->p[OMNI_AXES + i][OMNI_AXES + i] = i < slips ? config->p_slip : 0.0f;
    }
}

void omni_ekf_restart_noise(omni_pose_ekf_state_t *state) {
    state->noise_factor = 1.0f;
    state->slip_factor = 1.0f;
    state->fix_factor = 1.0f;
    memset(state->past, 0, sizeof state->past);
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
    state->white_factor = 1.0f;
    omni_sincosf(state->pose.theta, &state->slot_sine, &state->slot_cosine);
}

void omni_pose_ekf_set_pose(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, const omni_pose_t *pose,
                            uint64_t time_us) {
    omni_pose_ekf_reset(state, config, pose, omni_sqrtf(config->r_xy), omni_sqrtf(config->r_theta));
    state->time_us = time_us;
    state->told_us = time_us;
}

void omni_ekf_shift(omni_pose_ekf_state_t *state, const omni_real_t *delta, uint8_t columns) {
    move_pose(state, delta);
    for (uint8_t i = 0; i < columns; ++i) {
        state->slip[i] = omni_clampf(state->slip[i] + delta[OMNI_AXES + i], -slip_limit, slip_limit);
    }
    omni_ekf_history_rebase(state, columns);
}

void omni_ekf_settle(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, const omni_kinematics_t *k,
                     uint8_t slips, uint8_t columns) {
    if (state->unsettled_ticks == 0) {
        return;
    }
    if (columns == OMNI_EKF_COLUMNS) {
        omni_ekf_settle_turn(state, config, k, slips);
    } else if (columns == 3) {
        settle_columns(state, config, k, 3, 3);
    } else if (columns == 0) {
        settle_columns(state, config, k, 0, 0);
    } else {
        settle_columns(state, config, k, 4, 4);
    }
    if (state->slot_tick < OMNI_EKF_SLOT_TICKS) {
        state->settled = state->history[state->newest];
    }
}

void omni_pose_ekf_settle(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                          const omni_kinematics_t *k) {
    omni_ekf_settle(state, config, k, omni_ekf_slips(config, k), omni_ekf_columns(config, k));
}

void omni_ekf_change_states(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                            const omni_kinematics_t *k, uint8_t columns) {
    const uint8_t slips_before = state->mode == OMNI_EKF_MODE_SLIP ? k->wheels : 0;
    omni_ekf_settle(state, config, k, slips_before, state->columns);
    if (state->mode != config->mode) {
        omni_ekf_restart_slips(state, config, omni_ekf_slips(config, k));
        omni_ekf_history_rebase(state, 0);
        state->mode = config->mode;
    }
    state->columns = columns;
    if (state->slot_tick > 0) {
        omni_ekf_history_next(state);
    }
}

void omni_pose_ekf_predict(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                           const omni_kinematics_t *k, const omni_real_t *wheel_delta_rad, uint64_t time_us) {
    predict_motion(state, config, k, wheel_delta_rad, NULL, time_us);
}
