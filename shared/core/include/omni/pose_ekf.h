/* SPDX-License-Identifier: MIT */
/**
 * @file pose_ekf.h
 * Extended Kalman filter of the pose, from wheel motion and pose fixes. Fixes may be late and irregular, those that do
 * not fit are refused, and each wheel's slip ratio may be a state.
 *
 * State (x, y, theta [, s_1..s_n] [, b, k]): wheel i moves the contact point r phi'_i (1 - s_i), so that
 * v_s,i = s_i r phi'_i. A gyro has a bias b [rad/s] and an error k of its scale (omni/gyro.h).
 *
 *   d     = B+ (r dphi - v_s T)                             body motion over a tick, dphi from counts [report eq. 59]
 *   xi    = xi + R(theta + d_theta / 2)^T d                 prediction, heading of mid-step [report eq. 61]
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
 * which is exact for fixes that come in the order in which they were taken (docs/concepts/derivations/delayed_fix.md).
 * The cost is an ordinary update plus about 100 operations per history slot since t_f.
 *
 * P follows the motion where a history slot ends, and where something corrects the estimate; not in each tick.
 *
 * With a gyro, its rate z gives the turn of a tick in place of the wheels, d_theta = (1 + k) (z - b) T. What the wheels
 * say of the turn then measures the slip ratios, once per history slot. At rest they say 0, which measures the bias:
 *
 *   0 = sum over the slot of (1 + k) (z - b) T - sum over the wheels of B+_theta,i r dphi_i (1 - s_i) + noise
 *
 * (docs/concepts/derivations/gyro.md). The noise is at least the counts' rounding. Wheels that skid teach no slip:
 * while the mean of these innovations is larger than their variance allows, they are left out.
 *
 * A sensor of motion over the floor (omni/flow.h) says how far a point l of the body moved from t0 to t1. Its axes are
 * the body's of mid-way. The wheels predict d and its noise w, which is in the pose, too. With J l = (-ly, lx) and the
 * derivative G of d by s:
 *
 *   y = z - (d_xy + J l d_th, d_th),   H = G_s + J l G_th,s,   S = H P_ss H^T + W + C + R
 *   K = (P_s H^T + cov(x, w)) S^-1,    P = P - K S K^T
 *
 * Where wheels spin the reading may lead. Then all of y moves the pose, and with T = (1, -G; 0, 1), P = T P T^T + R.
 *
 * W is the wheels' noise q in t0..t1, C the counts' rounding at both ends. The history keeps what is left of W, so that
 * late fixes stay as they are (docs/concepts/derivations/floor_motion.md).
 *
 * How noisy the wheels' motion is depends on the floor. So a factor lambda multiplies q_xy, q_theta and q_slip, and the
 * innovations move it. With the right gain they are white; if they agree with those before, the gain is too low. With
 * S = L L^T the whitened innovation is v = L^-1 y. Its part that is not the fix's noise is k_i = 1 - R_i / L_ii^2. Per
 * fix that is used:
 *
 *   g      = sum k_i v_i u_i,   u_i = (1 - k_i) u_i + v_i afterwards        slope of the likelihood
 *   lambda = lambda (1 + adapt g),   at most +-OMNI_EKF_ADAPT_STEP a fix, OMNI_EKF_LEAST_NOISE..OMNI_EKF_MOST_NOISE
 *   rho    = rho (1 + adapt / 20 (min(y^T S^-1 y, 12) / 3 - 1 - margin)),   1..OMNI_EKF_MOST_FIX_NOISE
 *
 * rho multiplies the variance of a fix: squares that stay above what S says make the filter less sure. It cannot fall
 * below 1, so chance alone would hold it above: OMNI_EKF_FIX_MARGIN takes that away. Both stand still while the robot
 * does, without fixes, and for a fix that is refused. Both are 1 after a restart, and always with adapt = 0. q_slip
 * takes at most OMNI_EKF_MOST_SLIP_NOISE of lambda: fixes that are late and do not say so drive lambda to its end, and
 * slip ratios that follow each of them would spoil the motion between two fixes. What a slot of the history gathered is
 * kept with the factor of its time, so a late fix is still exact (docs/concepts/derivations/adaptive_noise.md).
 *
 * Process noise is white, but what wheels are off by lasts: between two fixes it grows with the distance D, not with
 * its root. A filter tuned for many fixes is overconfident between few, and would refuse every correct one. So a fix
 * whose NIS exceeds 16.27 (99.9 % of a chi-square with three degrees of freedom) is judged once more, with the
 * covariance that slip ratios of variance v cause over D. D is the wheels' distance since the last fix that was used (a
 * turn counts as the distance of a wheel, at the lever l; n wheels). A ratio may be wrong by a third of itself, too:
 *
 *   v = p_slip + sum (s_i / 3)^2,   P_xx, P_yy += v D^2,   P_theta += v D^2 / (n l^2)
 *
 * If the NIS is then at most 16.27, the fix is used with that P. If not, P stays, and the gate judges the fix as it
 * was. It is not done where v D^2 is below the variance of the fix: then slip explains less than the fix's own noise.
 * D keeps growing while fixes are refused, so the gate cannot lock out correct ones for long. An outlier is further
 * away than the wheels may have slipped since the last used fix. After a refused fix this is done only for one that
 * agrees with it (below): else a frozen tracker would be believed when D is long. Without a gate it is not done.
 *
 * The gate also refuses fixes after somebody has carried the robot. So refused fixes that agree with each other restart
 * the estimate: each one has moved since the first of them as the wheels say, up to slip ratios of variance p_slip and
 * the fixes' noise (95 %). gate_restart of them are needed; OMNI_EKF_RESTART_FIXES suffice if no fix was used for
 * OMNI_EKF_ALONE_US and the wheels have rolled OMNI_EKF_RESTART_M since the first. A tracker that is frozen does not
 * agree with wheels that roll, and is refused for good. With headings of fixes unknown only distances are compared.
 *
 * The noise that fixes ask for is what changes from one fix to the next. What stays the same for longer, they correct.
 * Without fixes it adds up. So q_xy and q_theta count (1 + alone) times when no fix was used, and no pose was set, for
 * OMNI_EKF_ALONE_US. A slot of the history in which neither wheels nor gyro have moved the robot brings none of it
 * then.
 *
 * Four wheels roll against each other: n^T r phi' is 0 for a rigid body on wheels that are as told. It measures the
 * slip ratios, n^T r phi' = n^T v_s, while fixes come. Real wheels have a mismatch of some percent there, from radii,
 * rollers and a frame that is not flat, and it lasts. Pushing against each other, they creep along n, which moves no
 * body (B+ n = 0). A ratio per wheel that explains the mismatch does move it. So without fixes, which would correct it,
 * n says nothing, and dead reckoning is the plain sum of the counts.
 *
 * Slip ratios change, and each has a mean over a long way: what the floor does, and what a wheel's radius is off. The
 * mean m_i follows s_i while fixes, or a sensor of motion over the floor, show it. Without them for OMNI_EKF_ALONE_US,
 * s_i returns to m_i. In a history slot the wheel rolls by l. L is the way seen so far, at most 10 m, and L_0 is 1 m:
 *
 *   seen:      m = m + l / (L + l + L_0) (s - m)
 *   not seen:  s = s + mean_rate L / (L + L_0) (m - s)
 *
 * A mean that was never seen changes nothing. Variances stay as without means
 * (docs/concepts/derivations/mean_slip.md).
 */
#ifndef OMNI_POSE_EKF_H
#define OMNI_POSE_EKF_H

#include "omni/kinematics.h"
#include "omni/params_gen.h"
#include "omni/types.h"

enum {
    OMNI_EKF_BIAS = OMNI_MAX_WHEELS,                /**< the gyro's bias among what follows the pose in the state */
    OMNI_EKF_SCALE,                                 /**< and the error of its scale */
    OMNI_EKF_COLUMNS,                               /**< slip ratios, bias and scale */
    OMNI_EKF_STATES = OMNI_AXES + OMNI_EKF_COLUMNS, /**< with the pose */
    OMNI_EKF_HISTORY = 64,                          /**< slots of the motion history */
    OMNI_EKF_SLOT_TICKS = 4,                        /**< most ticks of a slot: at 1 kHz a reach of 256 ms */
    OMNI_EKF_SLOT_US = 8000,                        /**< a slot is complete after this time, too */
    OMNI_EKF_ALONE_US = 2000000,                    /**< the filter is alone when no fix was used for longer */
    OMNI_EKF_RESTART_FIXES = 5                      /**< so many that agree restart a filter that is alone */
};

#define OMNI_EKF_RESTART_M                                                                                             \
    0.2f /**< if the wheels have rolled so far since the first: fixes that agree by
                                                 chance, or because nothing moves, do not count [m] */

#define OMNI_EKF_ADAPT_STEP 0.3f            /**< most that a fix changes lambda by, as a share of it */
#define OMNI_EKF_LEAST_NOISE (1.0f / 64.0f) /**< least lambda */
#define OMNI_EKF_MOST_NOISE 1024.0f         /**< greatest lambda: 32 times the deviation that is configured */
#define OMNI_EKF_MOST_SLIP_NOISE 4.0f       /**< greatest lambda that multiplies q_slip: 2 times the deviation */
#define OMNI_EKF_MOST_FIX_NOISE 16.0f       /**< greatest rho */
#define OMNI_EKF_FIX_MARGIN 0.1f            /**< share by which squares must be too large before rho grows */

typedef struct omni_pose_fix_t {
    uint64_t time_us; /**< when it was taken, robot clock */
    omni_pose_t pose;
    omni_real_t sd_xy;    /**< standard deviation, m; 0 takes the configured one */
    omni_real_t sd_theta; /**< standard deviation, rad; 0 takes the configured one */
} omni_pose_fix_t;

typedef struct omni_pose_ekf_config_t {
    uint8_t mode;          /**< enum omni_ekf_mode: odometry ignores fixes */
    omni_real_t q_xy;      /**< variance added to x and y per step, m^2 */
    omni_real_t q_theta;   /**< rad^2 per step */
    omni_real_t q_slip;    /**< per step, while the wheel turns and its ratio is known better than p_slip */
    omni_real_t p_slip;    /**< initial variance of a slip ratio; beyond it q_slip adds nothing from the next slot on */
    omni_real_t r_count;   /**< variance of what a wheel rolls in a history slot, from rounding to counts: m^2 */
    omni_real_t r_null;    /**< variance of n^T r phi' summed over a history slot, m^2: the counts' resolution,
                                      (r rad_per_count)^2 / 6, and creep. 0: four wheels' null direction is not used */
    omni_real_t r_xy;      /**< variance of a fix, m^2 */
    omni_real_t r_theta;   /**< rad^2 */
    omni_real_t gate;      /**< NIS above this is refused; 0: no gate */
    uint16_t gate_restart; /**< refused fixes that agree with each other after which the estimate restarts */
    omni_real_t step_s;
    bool gyro;             /**< there is one: its bias and the error of its scale are states */
    omni_real_t q_turn;    /**< variance that the gyro's noise adds to theta per step, rad^2 */
    omni_real_t q_bias;    /**< variance added to the bias per step, (rad/s)^2 */
    omni_real_t p_bias;    /**< its variance when the gyro is switched on */
    omni_real_t p_scale;   /**< variance of the scale's error then */
    omni_real_t adapt;     /**< how fast innovations move the noise levels, 0..1; 0: they stay as configured */
    omni_real_t flow_gate; /**< NIS above this is refused; 0: no gate */
    omni_real_t alone;     /**< share by which q_xy and q_theta are larger without fixes; 0: no difference */
    omni_real_t mean_rate; /**< share of the way to its mean that a slip ratio goes in a history slot, 0..1; 0: none */
} omni_pose_ekf_config_t;

/** What a gyro says of a tick. */
typedef struct omni_ekf_turn_t {
    omni_real_t rate_rad_s; /**< counter-clockwise, bias included; finite */
    omni_flag_t leads;      /**< it gives the turn; otherwise the wheels do */
    omni_flag_t rest;       /**< the wheels stand still, so it is the bias; never together with `leads` */
} omni_ekf_turn_t;

/** What a sensor of motion over the floor says. All finite. */
typedef struct omni_ekf_flow_t {
    omni_real_t move[OMNI_AXES]; /**< of its point: x, y [m] in body axes of mid-way; turn of the body [rad] */
    omni_real_t arm_m[2];        /**< the point, body frame */
    omni_real_t r_xy;            /**< variance of x and of y, m^2; > 0 */
    omni_real_t r_turn;          /**< rad^2; > 0 */
    bool turns;                  /**< the turn is measured; not used with a gyro, which leads it */
    omni_flag_t counts;          /**< otherwise it is only compared */
    omni_real_t lead_nis;        /**< NIS above which the wheels spin, and it counts in their place; 0: never */
    uint32_t age_us;             /**< since the end of what it measured */
    uint32_t span_us;            /**< that it measured; > 0 */
} omni_ekf_flow_t;

/** What came of it. */
typedef struct omni_ekf_flow_result_t {
    omni_real_t nis;
    omni_flag_t fits;       /**< within the gate */
    omni_flag_t led;        /**< it has counted in the wheels' place; then `fits` is false */
    omni_real_t expected_m; /**< way of the point that the wheels say */
    omni_real_t apart_m;    /**< how far the reading is from that */
    omni_real_t noise_m2;   /**< variance of the difference along one axis, if the slip ratios are right */
    omni_real_t
        rolled[OMNI_AXES];        /**< motion of the robot's centre if no wheel slipped, body axes of mid-way: m, rad */
    omni_real_t moved[OMNI_AXES]; /**< the same with the slip ratios that were known */
    omni_real_t seen[OMNI_AXES];  /**< the same as the reading says; the turn as `moved` where that is not measured */
} omni_ekf_flow_result_t;

/** What moved during one history slot, seen from the heading at its start. */
typedef struct omni_ekf_slot_t {
    omni_real_t move[OMNI_AXES];                   /**< dx, dy [m], dtheta [rad] with the slip ratios below */
    omni_real_t gain[OMNI_AXES][OMNI_EKF_COLUMNS]; /**< d move / d s_i, d b, d k */
    omni_real_t slip[OMNI_EKF_COLUMNS];            /**< slip ratios, bias, scale that `move` was computed with */
    omni_real_t noise[OMNI_MAX_WHEELS];            /**< variance each slip ratio gathered */
    omni_real_t steps;                             /**< nominal steps in the slot, each times its lambda */
    omni_real_t turn_noise;                        /**< variance that theta gathered, with a gyro */
    uint32_t duration_us;
    uint32_t ticks; /**< 0 while the slot is being filled */
} omni_ekf_slot_t;

typedef struct omni_pose_ekf_state_t {
    omni_pose_t pose;                   /**< estimate; theta in [-pi, pi) */
    omni_real_t carry[OMNI_AXES];       /**< what rounding has kept from `pose` so far */
    omni_real_t slip[OMNI_EKF_COLUMNS]; /**< slip ratios s_i; of the gyro: bias [rad/s], scale; all -0.5..0.5 */
    /** Covariance at the last tick that was settled: at most three ticks ago. Unused wheels' rows are zero. */
    omni_real_t p[OMNI_EKF_STATES][OMNI_EKF_STATES];
    omni_ekf_slot_t history[OMNI_EKF_HISTORY];
    omni_ekf_slot_t settled;              /**< the slot being filled, as it was when `p` was settled within it */
    omni_real_t wheel_m[OMNI_MAX_WHEELS]; /**< r phi of each wheel in the slot being filled */
    omni_real_t slot_cosine;              /**< of the heading at the start of the slot being filled */
    omni_real_t slot_sine;
    uint16_t newest;                   /**< slot being filled */
    uint8_t filled;                    /**< complete slots held */
    uint8_t slot_tick;                 /**< ticks in the slot being filled */
    uint8_t unsettled_ticks;           /**< of these the last ones, which `p` has not followed yet */
    uint8_t columns;                   /**< of the last tick: states after the pose */
    uint8_t mode;                      /**< mode of the last tick; another one restarts the slip states */
    uint64_t time_us;                  /**< of the estimate; 0: no tick yet */
    omni_real_t nis;                   /**< normalised innovation squared of the last fix that could be used */
    omni_real_t innovation[OMNI_AXES]; /**< its innovation: m, m, rad */
    omni_uint_t accepted;              /**< fixes used */
    omni_uint_t refused;               /**< fixes gated out, too old, from the future, or not finite */
    omni_uint_t restarts;
    uint16_t refused_in_row;     /**< gated out in a row, agreeing with the first of them */
    uint64_t last_fix_us;        /**< arrival of the last accepted fix; 0: none yet */
    uint64_t last_taken_us;      /**< when the last accepted fix was taken; 0: none yet */
    uint64_t told_us;            /**< when the pose was last told: by a fix that was used, set, or at the first tick */
    omni_real_t since_fix_m;     /**< D: sum over slots of |dx| + |dy| + l |dtheta| since a fix was used */
    omni_pose_t refused_first;   /**< of the refused fixes that agree with each other: the first one, */
    omni_pose_t refused_against; /**< the estimate at its time, */
    omni_real_t refused_from_m;  /**< and D then */
    omni_real_t turn_noise;      /**< variance of theta that is not in `p` yet: too little for its last bit */
    omni_real_t slot_turn_rad;   /**< gyro's rate summed over the slot being filled, bias included */
    omni_real_t slot_turn_s;     /**< time over which it was summed */
    omni_real_t slot_rest;       /**< ticks of the slot at rest, and those in which the gyro gave the turn */
    omni_real_t slot_turns;
    omni_real_t turn_apart;      /**< what the gyro turned less than the wheels in a slot [rad], mean of about eight */
    omni_real_t noise_factor;    /**< lambda: of q_xy and q_theta; > 0 */
    omni_real_t slip_factor;     /**< of q_slip: lambda, at most OMNI_EKF_MOST_SLIP_NOISE */
    omni_real_t white_factor;    /**< of q_xy and q_theta: lambda, and what being without fixes adds */
    omni_real_t fix_factor;      /**< rho: of a fix's variances; >= 1 */
    omni_real_t past[OMNI_AXES]; /**< u: whitened innovations so far, as far as they are in the estimate */
    /** Share of a slot's noise of x and y, and of theta, that is out of `p`: motion over the floor has measured it. */
    omni_real_t flow_known[OMNI_EKF_HISTORY][2];
    omni_int_t flow_slots;                   /**< newest slots among which there may be measured ones */
    omni_real_t mean_slip[OMNI_MAX_WHEELS];  /**< m: long-term mean of each slip ratio */
    omni_real_t mean_way_m[OMNI_MAX_WHEELS]; /**< L: way over which it was seen */
} omni_pose_ekf_state_t;

/** What is known of a gyro: bias [rad/s], error of the scale. */
typedef struct omni_ekf_gyro_t {
    omni_real_t value[2];
    omni_real_t p[2][2]; /**< their covariance */
} omni_ekf_gyro_t;

/** Start at `pose` with standard deviations sd_xy [m], sd_theta [rad]. */
void omni_pose_ekf_reset(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, const omni_pose_t *pose,
                         omni_real_t sd_xy, omni_real_t sd_theta);

/** A gyro has been switched on: bias and error of the scale are 0, with variances p_bias and p_scale. */
void omni_pose_ekf_start_gyro(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config);

/** What the filter knows of the gyro, to be kept over a restart. */
void omni_pose_ekf_get_gyro(const omni_pose_ekf_state_t *state, omni_ekf_gyro_t *known);
void omni_pose_ekf_set_gyro(omni_pose_ekf_state_t *state, const omni_ekf_gyro_t *known);

/**
 * The gyro that gave the turn for duration_s has proved wrong: take back what it turned more than the wheels.
 * @param doubt_rad [rad] its square is added to the heading's variance, which this raises by a uniform turn's at most
 */
void omni_pose_ekf_turn_back(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                             const omni_kinematics_t *k, omni_real_t turned_rad, omni_real_t duration_s,
                             omni_real_t doubt_rad);

/** Start at `pose`, known as well as a pose fix is by default. @param time_us robot clock; 0: no tick yet. */
void omni_pose_ekf_set_pose(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config, const omni_pose_t *pose,
                            uint64_t time_us);

/**
 * One tick of motion. @param wheel_delta_rad angle each wheel turned since the last tick, OMNI_MAX_WHEELS entries; a
 * tick with a value that isn't finite counts as no motion. @param time_us robot clock; a longer step brings
 * proportionally more noise. With four wheels and mode slip, while fixes come, n^T r phi' = n^T v_s corrects the slip
 * ratios once per history slot.
 */
void omni_pose_ekf_predict(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                           const omni_kinematics_t *k, const omni_real_t *wheel_delta_rad, uint64_t time_us);

/** The same with a gyro; `gyro` must be set in the configuration. @param turn what it says; neither leads nor rest: the
 * wheels alone count. */
void omni_pose_ekf_predict_turn(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                const omni_kinematics_t *k, const omni_real_t *wheel_delta_rad,
                                const omni_ekf_turn_t *turn, uint64_t time_us);

/**
 * The covariance follows the motion up to now. A tick does so where a history slot ends, and so does whatever uses the
 * covariance to correct. Call it to read `p` between.
 */
void omni_pose_ekf_settle(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                          const omni_kinematics_t *k);

/**
 * Use a fix, late or not. Enough refused ones that agree restart the estimate; the last of them counts as used.
 * @return OMNI_OK used. OMNI_ERR_RANGE gated out, or the covariance is spoilt. OMNI_ERR_TIME older than the
 * history, not newer than the last used one, from the future (> 5 ms), or no tick yet. OMNI_ERR_NOT_FINITE.
 * OMNI_ERR_LOCKED in mode odometry, which ignores fixes. When a fix is refused, counters and diagnostics
 * (nis, innovation) change, and the covariance is settled. Nothing else does.
 */
omni_result_t omni_pose_ekf_correct(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                    const omni_kinematics_t *k, const omni_pose_fix_t *fix);

/** Slip ratios stay, but count as unknown: the floor may have changed. */
void omni_pose_ekf_doubt_slips(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                               const omni_kinematics_t *k);

/**
 * What such a sensor has taught was wrong: slip ratios are 0 again, known as at the start. The pose moves back by
 * `taken`, and is known less by as much. @param taken how far it has moved by the sensor: x, y [m] in the world, rad.
 */
void omni_pose_ekf_take_back_flow(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                  const omni_kinematics_t *k, const omni_real_t *taken);

/** The pose is known less by as much. @param doubt standard deviations that are added: x, y [m], heading [rad]. */
void omni_pose_ekf_doubt_pose(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                              const omni_kinematics_t *k, const omni_real_t *doubt);

/**
 * Use what a sensor of motion over the floor says, if it counts and fits.
 * @return false if the history does not reach back that far: then only the covariance is settled.
 */
bool omni_pose_ekf_correct_flow(omni_pose_ekf_state_t *state, const omni_pose_ekf_config_t *config,
                                const omni_kinematics_t *k, const omni_ekf_flow_t *flow,
                                omni_ekf_flow_result_t *result);

#endif
