/* SPDX-License-Identifier: MIT */
/**
 * @file flow.h
 * Floor odometry sensor (optical flow or dead wheels): plausibility, qualification and use of its readings to correct
 * the pose EKF.
 *
 * Why: it measures slip and wheel spin, which encoders cannot see. A reading is the displacement of a point of the body
 * since the previous reading, in the sensor's axes, and optionally the turn of the body:
 *
 *   z_xy = scale R(mounting angle) reading_xy        in the body axes at mid-interval [m]
 *   z_th = reading_turn                              counter-clockwise [rad]
 *
 * The wheels predict the same displacement from the pose EKF's history. The residual corrects slip ratios and pose
 * (omni/pose_ekf.h).
 *
 * `valid`: bits 0 to 2 are set if x, y and turn are valid. Bit 3 is set if a reading was received, valid or not: the
 * next one is relative to it. So a dropped reading is bit 3 alone. Without bit 3 the reading is ignored.
 *
 * **Rejection.** A reading is rejected if it is not finite, larger than any robot can move meanwhile, or beyond the
 * gate (NIS). After OMNI_FLOW_INFLATE_AFTER consecutive rejections the floor may have changed: the slip covariance is
 * inflated, and again every OMNI_FLOW_INFLATE_PERIOD readings, if the residual is less than half of the distance. A
 * sensor that has never been used must have a verified alignment for that (below).
 *
 * **Timeout and faults.** It has timed out after OMNI_FLOW_TIMEOUT_TICKS without a valid reading. It is faulty
 *   - after OMNI_FLOW_FAULT_AFTER consecutive rejections, or if most of its last readings were rejected;
 *   - while it reads exactly zero and the wheels have moved by more than 20 mm;
 *   - if it repeats the same nonzero reading OMNI_FLOW_STUCK_AFTER times while the wheels' motion has changed by more
 *     than 1 mm and a tenth. Slip ratios are not used in this comparison: they would adapt to the stuck value.
 * Then only the wheels are used, until OMNI_FLOW_QUALIFY_AFTER readings in a row of a moving robot are within the gate.
 * After a timeout it must qualify in the same way.
 *
 * **Override.** No slip ratio describes wheels that spin or slide. Then a reading beyond the gate replaces the wheels'
 * motion. Conditions: its alignment is verified (below), and OMNI_FLOW_OVERRIDE_AFTER readings over distances far
 * beyond its noise were within the gate. A reading whose speed differs from the one before by more than
 * OMNI_FLOW_MAX_ACCELERATION_M_S2 is rejected and clears that number. An overriding reading counts as a misfit except
 * for the fault, which is raised after OMNI_FLOW_MAX_OVERRIDES of them. Five in a row within the gate end the override.
 *
 * **Misalignment.** A wrong mounting angle looks like slip. But slip shortens and lengthens displacements and does not
 * rotate them: B+ diag(s) B is symmetric in x and y (for evenly spaced wheels). With d the displacement by the wheels
 * without slip and z = A d fitted by least squares over about the last 2 m, the misalignment is
 *
 *   psi = atan2(A_yx - A_xy, A_xx + A_yy)
 *
 * It is known once the robot has moved in two directions, and by more than noise. A spinning wheel rotates the
 * displacement, too, but also changes the turn of the body, or the length. So readings with such a change are left out.
 * Of overriding readings only those without it are used, after OMNI_FLOW_MISALIGNED_AFTER in a row. Beyond 0.15 rad the
 * sensor is faulty, until psi is below 0.075 rad (beyond 0.25 rad while it overrides and does not measure the turn).
 * Its corrections are then undone: the slip ratios, and the pose corrections over the last 2 m or since the last fix.
 * The same is done if it does not fit within the first 2 m of its use.
 */
#ifndef OMNI_FLOW_H
#define OMNI_FLOW_H

#include "omni/pose_ekf.h"
#include "omni/types.h"

enum {
    OMNI_FLOW_TIMEOUT_TICKS = 200,  /**< ticks without a valid reading after which it has timed out */
    OMNI_FLOW_QUALIFY_AFTER = 5,    /**< consecutive readings within the gate, of a moving robot, before it is used */
    OMNI_FLOW_INFLATE_AFTER = 10,   /**< consecutive misfits after which the slip covariance is inflated, */
    OMNI_FLOW_INFLATE_PERIOD = 50,  /**< and further misfits until it is inflated again */
    OMNI_FLOW_FAULT_AFTER = 20,     /**< consecutive rejections after which it is faulty */
    OMNI_FLOW_STUCK_AFTER = 5,      /**< equal readings in a row after which it may be stuck */
    OMNI_FLOW_OVERRIDE_AFTER = 20,  /**< readings within the gate before it may override the wheels */
    OMNI_FLOW_MAX_OVERRIDES = 500,  /**< overriding readings after which it is no longer allowed to */
    OMNI_FLOW_MISALIGNED_AFTER = 25 /**< consecutive overriding readings that look misaligned before psi uses them */
};

#define OMNI_FLOW_MAX_ACCELERATION_M_S2 8.0f /**< more than wheels can accelerate a robot on any floor, m/s^2 */

/** Bits of omni_flow_tick_t::valid. */
enum { OMNI_FLOW_XY = 3, OMNI_FLOW_TURN = 4, OMNI_FLOW_RECEIVED = 8 };

typedef struct omni_flow_config_t {
    uint8_t axes;               /**< 0: no sensor; 2: x and y; 3: x, y and turn */
    omni_real_t mount_cosine;   /**< cosine of the mounting angle: sensor's x axis in the body frame */
    omni_real_t mount_sine;     /**< sine of the mounting angle */
    omni_real_t scale;          /**< true / measured distance */
    omni_real_t lever_arm_m[2]; /**< position of the sensor, body frame */
    omni_real_t r_xy;           /**< variance of x and of y of a reading, m^2 */
    omni_real_t r_relative;     /**< additional variance as a fraction of the distance squared */
    omni_real_t r_turn;         /**< variance of the turn of a reading, rad^2 */
    uint32_t delay_us;          /**< latency: end of the measured interval to the tick that gets the reading */
} omni_flow_config_t;

/** Sensor input of one tick. */
typedef struct omni_flow_tick_t {
    uint64_t time_us;           /**< robot clock */
    const omni_real_t *reading; /**< x, y [m], turn [rad] since the previous reading; any value */
    uint8_t valid;              /**< bits OMNI_FLOW_* */
    bool interval_valid;        /**< the tick had its nominal period */
} omni_flow_tick_t;

/** State of the sensor's supervision. All zero: never used. "In a row" ends with the first reading that differs. */
typedef struct omni_flow_state_t {
    uint64_t time_us;             /**< of the last tick */
    omni_flow_config_t config;    /**< of the last tick: a change restarts the qualification */
    uint64_t last_received_us;    /**< tick of the last reading, valid or not; 0: none */
    uint64_t last_valid_us;       /**< tick of the last valid reading, or of the start */
    bool faulty;                  /**< rejected too often, stuck, or misaligned */
    bool timed_out;               /**< no valid reading for OMNI_FLOW_TIMEOUT_TICKS */
    bool qualified;               /**< it may be used: OMNI_FLOW_QUALIFY_AFTER since it was last faulty or timed out */
    omni_uint_t consecutive_fits; /**< readings in a row within the gate while the robot moved */
    omni_uint_t consecutive_refusals;   /**< readings in a row beyond the gate, overriding ones left out */
    omni_uint_t readings_used;          /**< number of readings that corrected the estimate */
    omni_uint_t readings_rejected;      /**< number of readings that were implausible or beyond the gate */
    omni_uint_t consecutive_misfits;    /**< readings in a row beyond the gate, overriding ones included */
    omni_uint_t long_distance_fits;     /**< readings within the gate over distances far beyond noise, since a fault */
    omni_uint_t override_count;         /**< overriding readings, minus one for each reading within the gate */
    omni_uint_t consecutive_misaligned; /**< overriding readings in a row that look like a misaligned sensor */
    bool overriding;               /**< the wheels are overridden; ends after five readings in a row within the gate */
    bool alignment_verified;       /**< |psi| has been below 0.075 rad since it last qualified */
    uint64_t last_plausible_us;    /**< tick of the last plausible reading */
    omni_real_t last_speed_m_s[2]; /**< speed by that reading, body axes */
    omni_real_t unseen_distance_m[2]; /**< distance by the wheels along each axis since it last reported motion there */
    omni_real_t sum[OMNI_AXES];       /**< sum of all plausible readings in body axes: m, m, rad */
    omni_real_t zero_reading_m[2]; /**< displacement by the wheels while the readings are zero, body axes summed up */
    omni_real_t nis;               /**< normalised innovation squared of the last reading */
    omni_real_t last_reading[2];   /**< x and y of the last plausible reading, sensor axes */
    omni_uint_t repeated_readings; /**< readings in a row equal to the one before, and not zero */
    omni_real_t wheels_at_first_repeat_m[2]; /**< displacement by the wheels, without slip, at the first of them */
    bool stuck;                              /**< readings repeat although the wheels' motion has changed */
    omni_uint_t received;                    /**< number of readings, valid or not */
    omni_uint_t dropped;                     /**< number of readings without a valid x and y */
    omni_real_t rejection_rate;              /**< fraction of rejected readings, low-pass over about fifty */
    omni_real_t alignment_distance_m;        /**< distance within the window of the least-squares sums below */
    omni_real_t wheel_moments_m2[3];         /**< sums of d_x d_x, d_x d_y, d_y d_y */
    omni_real_t cross_moments_m2[2][2];      /**< sum of z d^T */
    omni_real_t override_distance_m;         /**< distance of overriding readings without a turn within the last 2 m */
    bool direction_known;                    /**< `misalignment_rad` is valid */
    bool misaligned;                         /**< psi is, or was when last known, beyond the threshold */
    omni_real_t misalignment_rad;            /**< psi; 0 while it is not known */
    omni_real_t accumulated_correction[OMNI_AXES]; /**< pose correction within the window: world, m, m, rad */
    omni_uint_t fixes;                             /**< number of pose fixes used at the last reading */
    omni_real_t used_distance_m;                   /**< distance of readings used since corrections were last undone */
} omni_flow_state_t;

/** One tick, after the pose EKF's prediction. @return false while the sensor is faulty or timed out. */
bool omni_flow_step(omni_flow_state_t *state, const omni_flow_config_t *config, const omni_flow_tick_t *tick,
                    omni_pose_ekf_state_t *ekf, const omni_pose_ekf_config_t *ekf_config, const omni_kinematics_t *k);

#endif
