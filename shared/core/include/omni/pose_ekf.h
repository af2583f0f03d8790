/* SPDX-License-Identifier: MIT */
/**
 * @file pose_ekf.h
 * Extended Kalman filter of the pose, from wheel odometry and pose fixes. Fixes may be delayed and irregular; outliers
 * are gated out; each wheel's slip ratio may be a state.
 *
 * State (x, y, theta [, s_1..s_n] [, b, k]): wheel i moves the contact point r phi'_i (1 - s_i), so that
 * v_s,i = s_i r phi'_i. A gyro has a bias b [rad/s] and an error k of its scale (omni/gyro.h).
 *
 *   d     = B+ (r dphi - v_s T)                             body motion over a tick, dphi from counts [report eq. 59]
 *   xi    = xi + R(theta + d_theta / 2)^T d                 prediction, heading at mid-step [report eq. 61]
 *   P     = F P F^T + Q,   F = [ 1 0 -dy;  0 1 dx;  0 0 1 ] (dx, dy) is d in the world frame [report eq. 62, 68]
 *   y     = z - H x,   S = H P H^T + R                      innovation, heading wrapped [report eq. 63, 64]
 *   K     = P H^T S^-1,   x = x + K y                       correction [report eq. 65, 66]
 *   P     = (I - K H) P (I - K H)^T + K R K^T               Joseph form [in place of report eq. 67]
 *
 * H picks the pose out of the state [report eq. 69]. The pose is accumulated with compensation: hours of driving lose
 * no precision.
 *
 * A fix taken at t_f arrives at t. Between the two the error moved by Phi(t, t_f). For planar odometry that is known
 * in closed form: (1, -dy; 1, dx; 1) and the accumulated slip sensitivity. The process noise W gathered since t_f is
 * in P(t) but not in the fix. With H = Phi_pose^-1 [I, -Phi_ps] and M = P - W the correction above becomes
 *
 *   S = H M H^T + R,   K = M H^T S^-1,   P = (I - K H) M (I - K H)^T + K R K^T + W
 *
 * which is exact for fixes that arrive in the order of their measurement (docs/concepts/derivations/delayed_fix.md).
 * The cost is an ordinary update plus about 100 operations per history slot since t_f.
 *
 * P is propagated at the end of a history slot and before each correction, not in each tick.
 *
 * With a gyro, its rate z gives the turn of a tick in place of the wheels, d_theta = (1 + k) (z - b) T. The turn by
 * the wheels then measures the slip ratios, once per history slot. At rest it is 0, which measures the bias:
 *
 *   0 = sum over the slot of (1 + k) (z - b) T - sum over the wheels of B+_theta,i r dphi_i (1 - s_i) + noise
 *
 * (docs/concepts/derivations/gyro.md). The noise is at least the encoder quantisation. Skidding
 * wheels must not bias the slip ratios: while the mean innovation exceeds its expected variance, it is not used.
 *
 * A floor odometry sensor (omni/flow.h) measures the displacement of a point l of the body from t0 to t1, in the body
 * axes at mid-interval. The wheels predict d with noise w, which is also in the pose. With J l = (-ly, lx) and the
 * derivative G of d by s:
 *
 *   y = z - (d_xy + J l d_th, d_th),   H = G_s + J l G_th,s,   S = H P_ss H^T + W + C + R
 *   K = (P_s H^T + cov(x, w)) S^-1,    P = P - K S K^T
 *
 * While wheels spin the reading may override them. Then the full y corrects the pose, and with T = (1, -G; 0, 1), P = T
 * P T^T + R.
 *
 * W is the process noise q in t0..t1, C the encoder quantisation at both ends. The history keeps the remaining W, so
 * that the correction by delayed fixes stays exact (docs/concepts/derivations/floor_motion.md).
 *
 * The process noise depends on the floor. So a factor lambda multiplies q_xy, q_theta and q_slip and is adapted from
 * the innovations. With the optimal gain they are white; if they are correlated in time, the gain is too low. With S =
 * L L^T the whitened innovation is v = L^-1 y. The fraction that is not the fix's noise is k_i = 1 - R_i / L_ii^2. Per
 * fix that is used:
 *
 *   g      = sum k_i v_i u_i,   u_i = (1 - k_i) u_i + v_i afterwards        slope of the likelihood
 *   lambda = lambda (1 + adapt_rate g)                      |change| <= OMNI_EKF_MAX_ADAPT_STEP,
 *                                                           OMNI_EKF_MIN_NOISE_FACTOR..OMNI_EKF_MAX_NOISE_FACTOR
 *   rho    = rho (1 + adapt_rate / 20 (min(y^T S^-1 y, 12) / 3 - 1 - OMNI_EKF_FIX_NOISE_MARGIN)),
 *                                                           1..OMNI_EKF_MAX_FIX_NOISE_FACTOR
 *
 * rho multiplies the variance of a fix: an NIS that stays above its expected value inflates it. As rho cannot fall
 * below 1, random variation alone would keep it above; OMNI_EKF_FIX_NOISE_MARGIN compensates that. Both are held while
 * the robot stands, without fixes, and for a refused fix. Both are 1 after a restart, and always with adapt_rate = 0.
 * The factor of q_slip is limited to OMNI_EKF_MAX_SLIP_NOISE_FACTOR: fixes with an unreported delay drive lambda to its
 * maximum, and slip ratios that follow each of them would spoil the prediction between two fixes. The history keeps
 * each slot's noise with the factor of its time, so a delayed fix is still exact
 * (docs/concepts/derivations/adaptive_noise.md).
 *
 * Process noise is white, but the wheels' errors are systematic: between two fixes they grow with the distance D, not
 * with its root. A filter tuned for frequent fixes is overconfident between rare ones and would refuse correct fixes.
 * So a fix whose NIS exceeds 16.27 (99.9 % of a chi-square with three degrees of freedom) is gated once more, with the
 * covariance that slip ratios of variance v cause over D. D is the wheels' distance since the last used fix (a turn
 * counts as the distance of a wheel at lever arm l; n wheels). A slip ratio is assumed wrong by a third of its value:
 *
 *   v = p_slip + sum (s_i / 3)^2,   P_xx, P_yy += v D^2,   P_theta += v D^2 / (n l^2)
 *
 * If the NIS is then at most 16.27, the fix is used with that P. If not, P is restored, and the gate uses the first
 * NIS. It is not done where v D^2 is below the variance of the fix: then slip explains less than the fix's own noise. D
 * keeps growing while fixes are refused, so the gate cannot lock out correct fixes permanently. An outlier is further
 * away than the possible slip since the last used fix. After a refused fix this is done only for a fix consistent with
 * it (below): otherwise a frozen tracker would be accepted once D is long. Without a gate it is not done.
 *
 * The gate also refuses fixes after the robot has been carried (the kidnapped robot). So consistent refused fixes
 * restart the estimate: each one has moved since the first of them as the wheels have, within slip ratios of variance
 * p_slip and the fixes' noise (95 %). gate_restart of them are needed; OMNI_EKF_RESTART_FIXES suffice in dead reckoning
 * (no fix used for OMNI_EKF_DEAD_RECKONING_AFTER_US) after OMNI_EKF_RESTART_DISTANCE_M since the first. A frozen
 * tracker is not consistent with rolling wheels and stays refused. If the fixes have no heading, only distances are
 * compared.
 *
 * The noise level tuned with fixes covers what changes between two fixes; fixes correct slower errors. In dead
 * reckoning those accumulate. So q_xy and q_theta are multiplied by (1 + dead_reckoning_noise) when no fix was used,
 * and no pose was set, for OMNI_EKF_DEAD_RECKONING_AFTER_US. A history slot without motion of wheels or gyro then adds
 * no noise.
 *
 * Four wheels are redundant: n^T r phi' is 0 for a rigid body on ideal wheels. It measures the slip ratios,
 * n^T r phi' = n^T v_s, while fixes arrive. Real wheels have a systematic mismatch of some percent there, from radii,
 * rollers and a frame that is not flat. They creep along n, which moves no body (B+ n = 0), but a slip ratio per wheel
 * that explains the mismatch would move it. So in dead reckoning, without fixes to correct it, n is not used, and the
 * estimate is the plain sum of the counts.
 *
 * Slip ratios vary about a long-term mean, caused by the floor and a radius error. The mean m_i follows s_i while fixes
 * or floor odometry make it observable. In dead reckoning s_i reverts to m_i. The wheel rolls by l in a history slot; L
 * is the observed distance so far, at most 10 m; L_0 = 1 m:
 *
 *   observable:    m = m + l / (L + l + L_0) (s - m)
 *   otherwise:     s = s + mean_reversion L / (L + L_0) (m - s)
 *
 * A mean without observations has no effect. Variances are not changed by the means
 * (docs/concepts/derivations/mean_slip.md).
 */
#ifndef OMNI_POSE_EKF_H
#define OMNI_POSE_EKF_H

#include "omni/kinematics.h"
#include "omni/params_gen.h"
#include "omni/types.h"

enum {
    OMNI_EKF_GYRO_BIAS = OMNI_MAX_WHEELS, /**< index of the gyro's bias in `error_state`; slip ratios are 0..3 */
    OMNI_EKF_GYRO_SCALE,                  /**< index of the gyro's scale error */
    OMNI_EKF_ERROR_STATES,                /**< slip ratios, gyro bias and gyro scale error */
    OMNI_EKF_STATES = OMNI_AXES + OMNI_EKF_ERROR_STATES, /**< pose and error states */
    OMNI_EKF_HISTORY = 64,                               /**< slots of the motion history */
    OMNI_EKF_SLOT_TICKS = 4,                    /**< maximum ticks of a slot: the history covers 256 ms at 1 kHz */
    OMNI_EKF_SLOT_US = 8000,                    /**< a slot is also complete after this time */
    OMNI_EKF_DEAD_RECKONING_AFTER_US = 2000000, /**< time without a used fix after which the filter is dead reckoning */
    OMNI_EKF_RESTART_FIXES = 5                  /**< consistent refused fixes that restart a filter in dead reckoning */
};

/** Distance [m] that the wheels must roll between the first and the last of OMNI_EKF_RESTART_FIXES. Without motion, a
 * frozen tracker would be consistent, too. */
#define OMNI_EKF_RESTART_DISTANCE_M 0.2f

#define OMNI_EKF_MAX_ADAPT_STEP 0.3f             /**< maximum relative change of lambda per fix */
#define OMNI_EKF_MIN_NOISE_FACTOR (1.0f / 64.0f) /**< minimum of lambda */
#define OMNI_EKF_MAX_NOISE_FACTOR 1024.0f        /**< maximum of lambda: 32 times the configured deviation */
#define OMNI_EKF_MAX_SLIP_NOISE_FACTOR 4.0f      /**< maximum factor of q_slip: 2 times the configured deviation */
#define OMNI_EKF_MAX_FIX_NOISE_FACTOR 16.0f      /**< maximum of rho */
#define OMNI_EKF_FIX_NOISE_MARGIN 0.1f           /**< relative excess of the mean NIS that leaves rho unchanged */

typedef struct omni_pose_fix_t {
    uint64_t time_us; /**< time of the measurement, robot clock */
    omni_pose_t pose;
    omni_real_t sd_xy;    /**< standard deviation, m; 0: use the configured one */
    omni_real_t sd_theta; /**< standard deviation, rad; 0: use the configured one */
} omni_pose_fix_t;

typedef struct omni_pose_ekf_config_t {
    uint8_t mode;        /**< enum omni_ekf_mode; mode odometry ignores fixes */
    omni_real_t q_xy;    /**< process noise of x and y per step, m^2 */
    omni_real_t q_theta; /**< process noise of theta per step, rad^2 */
    omni_real_t q_slip;  /**< process noise of a slip ratio per step, while its wheel turns and its variance < p_slip */
    omni_real_t p_slip;  /**< initial variance of a slip ratio; q_slip raises the variance no further */
    omni_real_t r_count; /**< variance of a wheel's distance per history slot from encoder quantisation, m^2 */
    omni_real_t r_null;  /**< variance of n^T r phi' summed over a history slot, m^2: encoder quantisation,
                                (r rad_per_count)^2 / 6, and creep. 0: the null direction of four wheels is not used */
    omni_real_t r_xy;    /**< default variance of a fix in x and y, m^2 */
    omni_real_t r_theta; /**< default variance of a fix in theta, rad^2 */
    omni_real_t gate;    /**< NIS threshold of a fix; 0: no gate */
    uint16_t gate_restart;            /**< consecutive consistent refused fixes that restart the estimate */
    omni_real_t step_s;               /**< nominal tick period */
    bool has_gyro;                    /**< estimate the gyro's bias and scale error */
    omni_real_t q_gyro;               /**< variance that the gyro's noise adds to theta per step, rad^2 */
    omni_real_t q_bias;               /**< process noise of the gyro's bias per step, (rad/s)^2 */
    omni_real_t p_bias;               /**< initial variance of the bias, (rad/s)^2 */
    omni_real_t p_scale;              /**< initial variance of the scale error */
    omni_real_t adapt_rate;           /**< gain of the noise adaptation, 0..1; 0: noise levels stay as configured */
    omni_real_t flow_gate;            /**< NIS threshold of a floor odometry reading; 0: no gate */
    omni_real_t dead_reckoning_noise; /**< relative increase of q_xy and q_theta in dead reckoning; 0: none */
    omni_real_t mean_reversion; /**< fraction of (mean - slip ratio) that is added per history slot, 0..1; 0: none */
} omni_pose_ekf_config_t;

/** Yaw rate of one tick by the gyro. */
typedef struct omni_ekf_gyro_rate_t {
    omni_real_t rate_rad_s; /**< counter-clockwise, bias included; finite */
    bool overrides_wheels;  /**< the gyro gives the turn of this tick; false: the wheels do */
    bool at_rest;           /**< the robot is at rest, so the rate measures the bias; excludes `overrides_wheels` */
} omni_ekf_gyro_rate_t;

/** A reading of the floor odometry sensor (optical flow or dead wheels). All finite. */
typedef struct omni_ekf_flow_t {
    omni_real_t
        move[OMNI_AXES]; /**< displacement of the sensor: x, y [m] in the body axes at mid-interval; turn [rad] */
    omni_real_t lever_arm_m[2]; /**< position of the sensor, body frame */
    omni_real_t r_xy;           /**< variance of x and of y, m^2; > 0 */
    omni_real_t r_turn;         /**< variance of the turn, rad^2; > 0 */
    bool measures_turn;         /**< `move[2]` is measured; ignored with a gyro, which is more accurate */
    bool apply;                 /**< correct the estimate; false: compute the residual only */
    omni_real_t override_nis;   /**< NIS above which the reading replaces the wheels' motion; 0: never */
    uint32_t age_us;            /**< time since the end of the measured interval */
    uint32_t span_us;           /**< length of the measured interval; > 0 */
} omni_ekf_flow_t;

/** Residual of a floor odometry reading, and what was done with it. Displacements are of the robot's centre in the body
 * axes at mid-interval: m, m, rad. */
typedef struct omni_ekf_flow_result_t {
    omni_real_t nis;
    bool within_gate;                 /**< false also if it overrode the wheels */
    bool overrode_wheels;             /**< it replaced the wheels' motion in the estimate */
    omni_real_t predicted_m;          /**< distance of the sensor predicted from the wheels */
    omni_real_t residual_m;           /**< length of (measured - predicted) */
    omni_real_t residual_variance_m2; /**< variance of the residual along one axis, given the slip ratios */
    omni_real_t no_slip[OMNI_AXES];   /**< displacement by the wheels without slip */
    omni_real_t predicted[OMNI_AXES]; /**< displacement by the wheels with the estimated slip ratios */
    omni_real_t measured[OMNI_AXES];  /**< displacement by the sensor; turn: `predicted` unless it is measured */
} omni_ekf_flow_result_t;

/** Motion during one history slot, in the body axes at its start. */
typedef struct omni_ekf_slot_t {
    omni_real_t move[OMNI_AXES];                            /**< dx, dy [m], dtheta [rad] with `error_state` */
    omni_real_t jacobian[OMNI_AXES][OMNI_EKF_ERROR_STATES]; /**< d move / d error_state */
    omni_real_t error_state[OMNI_EKF_ERROR_STATES];         /**< slip ratios, bias, scale at which it is linearised */
    omni_real_t slip_noise[OMNI_MAX_WHEELS];                /**< process noise of each slip ratio over the slot */
    omni_real_t steps;      /**< number of nominal steps, each multiplied by its noise factor */
    omni_real_t turn_noise; /**< process noise of theta over the slot, with a gyro [rad^2] */
    uint32_t duration_us;
    uint32_t ticks; /**< 0 until the slot is complete */
} omni_ekf_slot_t;

typedef struct omni_pose_ekf_state_t {
    omni_pose_t pose;                          /**< estimate; theta in [-pi, pi) */
    omni_real_t kahan_compensation[OMNI_AXES]; /**< rounding error of `pose`, to be added with the next increment */
    omni_real_t error_state[OMNI_EKF_ERROR_STATES]; /**< slip ratios; gyro bias [rad/s], scale error; all -0.5..0.5 */
    /** Covariance at the tick of the last propagation, at most three ticks ago. Rows of unused wheels are zero. */
    omni_real_t p[OMNI_EKF_STATES][OMNI_EKF_STATES];
    omni_ekf_slot_t history[OMNI_EKF_HISTORY];
    omni_ekf_slot_t last_propagated_slot;      /**< the open slot as it was when `p` was last propagated within it */
    omni_real_t slot_wheel_m[OMNI_MAX_WHEELS]; /**< distance rolled by each wheel in the open slot, r phi */
    omni_real_t slot_cosine;                   /**< cosine of the heading at the start of the open slot */
    omni_real_t slot_sine;
    uint16_t open_slot;                   /**< index of the slot being filled */
    uint8_t complete_slots;               /**< number of complete slots in the history */
    uint8_t slot_ticks;                   /**< ticks in the open slot */
    uint8_t unpropagated_ticks;           /**< ticks of the open slot that `p` does not contain yet */
    uint8_t error_states;                 /**< number of error states in the last tick */
    uint8_t mode;                         /**< mode in the last tick; a change restarts the slip ratios */
    uint64_t time_us;                     /**< time of the estimate; 0: no tick yet */
    omni_real_t nis;                      /**< normalised innovation squared of the last fix with a usable time */
    omni_real_t innovation[OMNI_AXES];    /**< innovation of that fix: m, m, rad */
    omni_uint_t accepted;                 /**< number of fixes used */
    omni_uint_t refused;                  /**< number of fixes gated out, too old, from the future, or not finite */
    omni_uint_t restarts;                 /**< number of restarts from refused fixes */
    uint16_t consecutive_refusals;        /**< fixes gated out in a row that are consistent with the first of them */
    uint64_t last_fix_us;                 /**< arrival of the last used fix; 0: none yet */
    uint64_t last_fix_taken_us;           /**< measurement time of the last used fix; 0: none yet */
    uint64_t last_absolute_update_us;     /**< last used fix, set pose or first tick */
    omni_real_t distance_since_fix_m;     /**< D: sum over slots of |dx| + |dy| + l |dtheta| since the last used fix */
    omni_pose_t first_refused_fix;        /**< first of the consistent refused fixes, */
    omni_pose_t first_refused_estimate;   /**< the estimate at its time, */
    omni_real_t first_refused_distance_m; /**< and D then */
    omni_real_t pending_turn_noise;       /**< noise of theta not in `p` yet: below the resolution of its variance */
    omni_real_t slot_gyro_rad;            /**< gyro's rate integrated over the open slot, bias included */
    omni_real_t slot_gyro_s;              /**< time over which it was integrated */
    omni_real_t slot_rest_ticks;          /**< ticks of the open slot at rest */
    omni_real_t slot_gyro_ticks;          /**< ticks of the open slot in which the gyro gave the turn */
    omni_real_t yaw_residual_mean_rad;    /**< (wheels' turn - gyro's turn) per slot, low-pass over about eight slots */
    omni_real_t noise_factor;             /**< lambda: factor of q_xy and q_theta; > 0 */
    omni_real_t slip_noise_factor;        /**< factor of q_slip: lambda, at most OMNI_EKF_MAX_SLIP_NOISE_FACTOR */
    omni_real_t pose_noise_factor;        /**< factor of q_xy and q_theta: lambda and the increase in dead reckoning */
    omni_real_t fix_noise_factor;         /**< rho: factor of a fix's variances; >= 1 */
    omni_real_t whitened_innovation_sum[OMNI_AXES]; /**< u: decaying sum of whitened innovations */
    /** Fraction of each slot's noise of x and y, and of theta, that floor odometry has removed from `p`. */
    omni_real_t flow_noise_removed[OMNI_EKF_HISTORY][2];
    uint8_t flow_slots;                     /**< number of newest slots among which `flow_noise_removed` may be > 0 */
    omni_real_t mean_slip[OMNI_MAX_WHEELS]; /**< m: long-term mean of each slip ratio */
    omni_real_t mean_slip_distance_m[OMNI_MAX_WHEELS]; /**< L: rolled distance in that mean, at most 10 m */
} omni_pose_ekf_state_t;

/** Estimate of the gyro's errors: bias [rad/s], scale error. */
typedef struct omni_ekf_gyro_calibration_t {
    omni_real_t value[2];
    omni_real_t p[2][2]; /**< covariance */
} omni_ekf_gyro_calibration_t;

/** Restart at `pose` with standard deviations sd_xy [m] and sd_theta [rad]; error states 0. */
void omni_pose_ekf_reset(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, const omni_pose_t *pose,
                         omni_real_t sd_xy, omni_real_t sd_theta);

/** Set the gyro's bias and scale error to 0 with variances p_bias and p_scale: after power-on or a changed gyro. */
void omni_pose_ekf_start_gyro(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config);

/** Read and write the gyro's calibration, to keep it over a reset of the filter. */
void omni_pose_ekf_get_gyro(const omni_pose_ekf_state_t *state, omni_ekf_gyro_calibration_t *known);
void omni_pose_ekf_set_gyro(omni_pose_ekf_state_t *state, const omni_ekf_gyro_calibration_t *known);

/**
 * Undo the heading change by a gyro that has proved wrong.
 * @param turned_rad gyro's turn minus the wheels' over duration_s; it is subtracted from the heading.
 * @param doubt_rad standard deviation added to the heading's; limited to that of an unknown heading.
 */
void omni_pose_ekf_undo_gyro_turn(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                  const omni_kinematics_t *k, omni_real_t turned_rad, omni_real_t duration_s,
                                  omni_real_t doubt_rad);

/** Restart at `pose` with the variances of a default pose fix. @param time_us robot clock; 0: no tick yet. */
void omni_pose_ekf_set_pose(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, const omni_pose_t *pose,
                            uint64_t time_us);

/**
 * Prediction over one tick, without a gyro. @param wheel_delta_rad rotation of each wheel since the last tick,
 * OMNI_MAX_WHEELS entries; a tick with a value that isn't finite counts as no motion. @param time_us robot clock; the
 * process noise is proportional to the elapsed time. With four wheels and mode slip, while fixes arrive, n^T r phi' =
 * n^T v_s corrects the slip ratios once per history slot.
 */
void omni_pose_ekf_predict(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                           const omni_kinematics_t *k, const omni_real_t *wheel_delta_rad, uint64_t time_us);

/** Prediction over one tick with a gyro; needs `has_gyro`. @param turn neither overrides_wheels nor at_rest: only the
 * wheels are used. */
void omni_pose_ekf_predict_gyro(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                const omni_kinematics_t *k, const omni_real_t *wheel_delta_rad,
                                const omni_ekf_gyro_rate_t *turn, uint64_t time_us);

/**
 * Propagate the covariance to the time of the estimate. The filter itself does it at the end of a history slot and
 * before each correction. Call it before reading `p` at any other time.
 */
void omni_pose_ekf_propagate_covariance(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                        const omni_kinematics_t *k);

/**
 * Correct with a fix, delayed or not. Enough consistent refused fixes restart the estimate; the last of them counts as
 * used.
 * @return OMNI_OK used. OMNI_ERR_RANGE gated out, or the covariance is not positive definite. OMNI_ERR_TIME older than
 * the history, not newer than the last used one, from the future (> 5 ms), or no tick yet. OMNI_ERR_NOT_FINITE.
 * OMNI_ERR_LOCKED in mode odometry. A refused fix changes counters and diagnostics (nis, innovation) only, and
 * propagates the covariance.
 */
omni_result_t omni_pose_ekf_correct(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                    const omni_kinematics_t *k, const omni_pose_fix_t *fix);

/** Keep the slip ratios, but raise their variance to that of an unknown floor and clear their covariances. */
void omni_pose_ekf_inflate_slip_covariance(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                           const omni_kinematics_t *k);

/**
 * Undo the corrections by a floor odometry sensor that has proved wrong: slip ratios are reset to 0 with variance
 * p_slip, and the pose is moved back. @param taken sum of its corrections of the pose: x, y [m] in the world, rad. It
 * is also added to the standard deviations.
 */
void omni_pose_ekf_undo_flow_updates(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                     const omni_kinematics_t *k, const omni_real_t *taken);

/**
 * Compute the residual of a floor odometry reading; correct the estimate if `flow->apply` and it is within the gate.
 * @return false if the interval is beyond the history: then the covariance is propagated, and nothing else changes.
 */
bool omni_pose_ekf_correct_flow(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                const omni_kinematics_t *k, const omni_ekf_flow_t *flow,
                                omni_ekf_flow_result_t *result);

#endif
