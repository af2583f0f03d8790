/* SPDX-License-Identifier: MIT */
/**
 * @file gyro.h
 * Gyro: from raw readings to a yaw rate for the pose EKF, with plausibility checks.
 *
 * Why: a gyro measures the turn of the body independently of wheel slip, but with a bias. The pose EKF estimates the
 * bias (omni/pose_ekf.h); this module decides when a reading measures the bias and when it overrides the wheels:
 *
 *   z                : scale * (+-) reading[axis]         yaw rate, counter-clockwise [rad/s]
 *   at_rest          : no wheel has moved for OMNI_GYRO_REST_TICKS, and |z - b| < 0.02 rad/s + 5 sd(b)
 *   overrides_wheels : not at rest, and sd(b) is below a tenth of its initial value
 *
 * A robot that is carried turns while its wheels stand still: it is not at rest, and the gyro gives the turn.
 *
 * **Rejected readings:** not finite, saturated, OMNI_GYRO_STUCK_SAMPLES equal ones in a row, or none received for
 * OMNI_GYRO_HOLD_TICKS. Then only the wheels are used, until OMNI_GYRO_GOOD_SAMPLES valid readings in a row. Between
 * two readings the last one is held, for sensors slower than the tick.
 *
 * **Wrong axis, sign or scale.** While the motors drive, gyro and wheels are compared over windows of 0.25 rad of turn
 * by the wheels. The gyro must have turned in the same direction by 0.5 to 2 times as much. It is rejected after
 * OMNI_GYRO_REJECT_WINDOWS windows in a row without that, or after one in the opposite direction. Once it has agreed,
 * windows are 3 rad long; as skidding wheels turn more than the body, only a gyro that reads less than a tenth of the
 * wheels' turn is rejected then. It is used again after 3 rad with a ratio of 0.8 to 1.25. On rejection its heading
 * change relative to the wheels is undone and, unless the direction was opposite, added to the heading's standard
 * deviation.
 *
 * **Bias steps.** A robot that holds its estimated heading turns physically after a step of the bias: the wheels turn
 * it on the spot at a steady 0.01 to 0.2 rad/s, and the gyro reads less than a quarter of that. After
 * OMNI_GYRO_CREEP_SECONDS the difference is taken as bias, and the heading change is undone in the same way.
 */
#ifndef OMNI_GYRO_H
#define OMNI_GYRO_H

#include "omni/pose_ekf.h"
#include "omni/types.h"

enum {
    OMNI_GYRO_HOLD_TICKS = 20,     /**< maximum ticks for which a reading is held */
    OMNI_GYRO_GOOD_SAMPLES = 100,  /**< valid readings in a row before it is used */
    OMNI_GYRO_STUCK_SAMPLES = 100, /**< equal readings in a row that no gyro's noise allows */
    OMNI_GYRO_REST_TICKS = 100,    /**< ticks without a count after which the robot is at rest */
    OMNI_GYRO_BIAS_RESTART_TICKS =
        30000,                     /**< ticks with still wheels and a turning gyro after which that is its bias */
    OMNI_GYRO_REJECT_WINDOWS = 3,  /**< consecutive windows contradicting the wheels after which it is rejected */
    OMNI_GYRO_CREEP_SECONDS = 10,  /**< seconds of creep on the spot, unseen by the gyro, that reveal a bias step */
    OMNI_GYRO_WARNING_TICKS = 5000 /**< duration of the warning after a bias step */
};

typedef struct omni_gyro_config_t {
    int8_t axis;             /**< chip axis that points up: 1 x, 2 y, 3 z; negative: down; 0: no gyro */
    omni_real_t scale;       /**< true / measured rate */
    omni_real_t range_rad_s; /**< a reading of this magnitude or more is saturated */
} omni_gyro_config_t;

/** Sensor input of one tick. */
typedef struct omni_gyro_tick_t {
    uint64_t time_us;           /**< robot clock */
    const omni_real_t *reading; /**< about the chip's x, y, z [rad/s]; any value */
    uint8_t valid;              /**< bit per axis: new in this tick */
    bool interval_valid;        /**< `duration_s` can be used */
    omni_real_t duration_s;
    omni_real_t wheel_yaw_rate_rad_s; /**< yaw rate by the wheels without slip */
    omni_real_t wheels_x_m_s;         /**< body speed by the wheels, body frame */
    omni_real_t wheels_y_m_s;
    bool wheels_still;  /**< no encoder has counted in this tick */
    bool motors_driven; /**< a motor has a voltage */
} omni_gyro_tick_t;

/** State of the gyro's supervision. All zero: never used. */
typedef struct omni_gyro_state_t {
    uint64_t time_us;  /**< of the last tick */
    omni_real_t scale; /**< configuration in the last tick: a change restarts the gyro */
    int8_t axis;
    bool ready;                        /**< the bias has been learned */
    bool faulty;                       /**< readings are missing, stuck or saturated */
    bool rejected;                     /**< it contradicts the wheels */
    omni_uint_t agreed_with_wheels;    /**< 1: it has agreed with the wheels over a window */
    omni_uint_t wrong_windows;         /**< consecutive windows in which it contradicted the wheels */
    omni_real_t reading;               /**< the newest, raw */
    omni_real_t rate_rad_s;            /**< yaw rate of the newest valid reading, counter-clockwise */
    uint16_t silent_ticks;             /**< ticks since the last reading */
    uint16_t good_samples;             /**< valid readings in a row */
    omni_uint_t repeated_samples;      /**< equal readings in a row */
    omni_uint_t wheels_still_ticks;    /**< ticks in a row without a count */
    omni_uint_t rest_ticks;            /**< of these, ticks in a row in which the gyro read about its bias */
    omni_real_t window_rad;            /**< length of the comparison window: turn by the wheels */
    omni_real_t wheel_turn_rad;        /**< |turn| by the wheels within the window */
    omni_real_t gyro_along_wheels_rad; /**< turn by the gyro within the window, positive in the wheels' direction */
    omni_real_t gyro_turn_rad;         /**< |turn| by the gyro within the window */
    omni_real_t yaw_residual_rad; /**< (gyro's turn - wheels' turn) while it overrode the wheels, since they agreed */
    omni_real_t yaw_residual_s;   /**< time over which that was summed */
    omni_real_t second_wheel_turn_rad;          /**< turn by the wheels in the current second, signed */
    omni_real_t previous_second_wheel_turn_rad; /**< the same of the second before */
    omni_real_t second_gyro_turn_rad;           /**< turn by the gyro in the current second */
    omni_real_t second_x_m;                     /**< displacement in the current second, body frame */
    omni_real_t second_y_m;
    omni_real_t second_s;           /**< time in the current second in which the gyro overrode the wheels */
    uint64_t second_end_us;         /**< end of the current second */
    omni_uint_t creep_seconds;      /**< consecutive seconds of creep on the spot that the gyro did not see */
    omni_real_t creep_rad;          /**< (gyro's turn - wheels' turn) in these seconds */
    omni_real_t creep_s;            /**< duration of these seconds */
    omni_uint_t warning_ticks_left; /**< remaining ticks of the warning after a bias step */
    omni_ekf_gyro_rate_t turn;      /**< output for the pose EKF in this tick */
} omni_gyro_state_t;

/**
 * One tick, before omni_pose_ekf_predict_gyro, which takes `state->turn`. Restarts the bias in `ekf` for a new gyro,
 * and undoes the heading change of one that proves wrong.
 * @return false while the readings cannot be used, and for OMNI_GYRO_WARNING_TICKS after a bias step.
 */
bool omni_gyro_step(omni_gyro_state_t *state, const omni_gyro_config_t *config, const omni_gyro_tick_t *tick,
                    omni_pose_ekf_state_t *ekf, const omni_pose_ekf_config_t *ekf_config, const omni_kinematics_t *k);

#endif
