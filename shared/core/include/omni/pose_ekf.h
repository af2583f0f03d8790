/* SPDX-License-Identifier: MIT */
/**
 * @file pose_ekf.h
 * Pose from wheel motion and pose fixes (eq. 57-69, corrected), with late and irregular fixes, innovation gating, and
 * optionally each wheel's slip ratio as a state.
 *
 * State (x, y, theta [, s_1..s_n]): wheel i moves the contact point r phi'_i (1 - s_i), so v_s,i = s_i r phi'_i.
 * Prediction integrates counts with the heading of mid-step. x and y are accumulated with compensation: hours of driving
 * lose no precision.
 *
 * A fix taken at t_f arrives at t. Between the two the error moved by Phi(t, t_f), which for planar odometry is known
 * in closed form (1, -dy; 1, dx; 1 and the accumulated slip sensitivity); process noise W gathered since t_f is in P(t) but not in the
 * fix. Hence e(t_f) = H e(t) - Phi_pose^-1 w; gain, innovation covariance and Joseph update follow exactly (docs/derivations/delayed_fix.md)
 * at the cost of one ordinary update, whatever the delay.
 */
#ifndef OMNI_POSE_EKF_H
#define OMNI_POSE_EKF_H

#include "omni/kinematics.h"
#include "omni/params_gen.h"
#include "omni/types.h"

enum {
    OMNI_EKF_STATES = OMNI_AXES + OMNI_MAX_WHEELS,
    OMNI_EKF_HISTORY = 64,       /**< slots of the motion history */
    OMNI_EKF_SLOT_TICKS = 4      /**< ticks per slot: 256 ticks of reach */
};

typedef struct omni_pose_fix_t {
    uint64_t time_us;            /**< when it was taken, robot clock */
    omni_pose_t pose;
    omni_real_t sd_xy;           /**< standard deviation, m; 0 takes the configured one */
    omni_real_t sd_theta;        /**< standard deviation, rad; 0 takes the configured one */
} omni_pose_fix_t;

typedef struct omni_pose_ekf_config_t {
    uint8_t mode;                /**< enum omni_ekf_mode: odometry ignores fixes */
    omni_real_t q_xy;            /**< variance added to x and y per step, m^2 */
    omni_real_t q_theta;         /**< rad^2 per step */
    omni_real_t q_slip;          /**< per step, while the wheel turns */
    omni_real_t p_slip;          /**< initial variance of a slip ratio */
    omni_real_t r_xy;            /**< variance of a fix, m^2 */
    omni_real_t r_theta;         /**< rad^2 */
    omni_real_t gate;            /**< NIS above this is refused; 0: no gate */
    uint16_t gate_restart;       /**< refused fixes in a row after which the estimate restarts */
    omni_real_t step_s;
} omni_pose_ekf_config_t;

/** What moved during one history slot. */
typedef struct omni_ekf_slot_t {
    omni_real_t dx;                                     /**< world displacement, m */
    omni_real_t dy;
    omni_real_t dtheta;
    omni_real_t gain[OMNI_AXES][OMNI_MAX_WHEELS];       /**< pose change per unit of slip ratio, at slot end */
} omni_ekf_slot_t;

typedef struct omni_pose_ekf_state_t {
    omni_pose_t pose;                                   /**< estimate; theta in [-pi, pi) */
    omni_real_t carry[2];                               /**< compensation of the x and y sums */
    omni_real_t slip[OMNI_MAX_WHEELS];                  /**< slip ratios s_i */
    omni_real_t p[OMNI_EKF_STATES][OMNI_EKF_STATES];    /**< covariance; unused wheels' rows are zero */
    omni_ekf_slot_t history[OMNI_EKF_HISTORY];
    uint16_t newest;                                    /**< slot being filled */
    uint8_t filled;                                     /**< complete slots held */
    uint8_t slot_tick;                                  /**< ticks in the slot being filled */
    uint64_t time_us;                                   /**< of the estimate */
    omni_real_t nis;                                    /**< normalised innovation squared of the last fix */
    omni_real_t innovation[OMNI_AXES];
    uint32_t accepted;                                  /**< fixes used */
    uint32_t refused;                                   /**< fixes gated out, too old, from the future, or not finite */
    uint32_t restarts;
    uint16_t refused_in_row;
    uint64_t last_fix_us;                               /**< arrival of the last accepted fix; 0: none yet */
} omni_pose_ekf_state_t;

/** Start at `pose` with standard deviations sd_xy [m], sd_theta [rad]. */
void omni_pose_ekf_reset(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, const omni_pose_t *pose,
                         omni_real_t sd_xy, omni_real_t sd_theta);

/**
 * One tick of motion. @param wheel_delta_rad angle each wheel turned since the last tick, OMNI_MAX_WHEELS entries.
 * With four wheels and mode slip, n^T r phi' = n^T v_s corrects the slip ratios too.
 */
void omni_pose_ekf_predict(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                           const omni_kinematics_t *k, const omni_real_t *wheel_delta_rad, uint64_t time_us);

/**
 * Use a fix, late or not.
 * @return OMNI_OK used; OMNI_ERR_RANGE gated out; OMNI_ERR_TIME older than the history or from the future (> 5 ms);
 *         OMNI_ERR_NOT_FINITE. Nothing but the counters changes when a fix is refused.
 */
omni_result_t omni_pose_ekf_correct(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                    const omni_kinematics_t *k, const omni_pose_fix_t *fix);

#endif
