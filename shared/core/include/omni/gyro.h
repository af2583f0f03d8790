/* SPDX-License-Identifier: MIT */
/**
 * @file gyro.h
 * A gyro's readings become a turn rate that the pose EKF can use, or are left out.
 *
 * A gyro knows how fast the body turns, whatever the wheels do on the floor. But it reads a rate at rest, too: its
 * bias. So the pose EKF has the bias as a state (omni/pose_ekf.h), and this module says when a reading may lead:
 *
 *   z     = scale * (+-) reading[axis]              rate about the vertical axis, counter-clockwise [rad/s]
 *   rest  : no wheel has moved for OMNI_GYRO_REST_TICKS, and |z - b| < 0.02 rad/s + 5 sd(b)
 *   leads : not at rest, and the bias has been learned to a tenth of what it was known at the start
 *
 * A robot that is carried turns while its wheels stand: that is no rest, and the gyro leads.
 *
 * A reading that is not finite or saturated is left out, and the wheels count alone. So are OMNI_GYRO_STUCK_SAMPLES
 * equal ones in a row, and all if none came for more than OMNI_GYRO_HOLD_TICKS. After that OMNI_GYRO_GOOD_SAMPLES good
 * ones in a row are needed. A sensor that is slower than the tick is held in between.
 *
 * The wheels notice a wrong axis, sign or scale. While motors drive they are compared over each 0.25 rad that they turn
 * the body. The gyro must have turned the same way, half as far to twice as far. One that has not in OMNI_GYRO_WINDOWS
 * windows in a row is left out, and one that turns the other way at once. After it has agreed, windows are 3 rad long.
 * Wheels that skid turn farther than the body. So only one that sees less than a tenth of the wheels' turn, in so many
 * of them, is left out then. It is used again when it has turned 0.8 to 1.25 times as far over 3 rad. What the heading
 * was turned beyond the wheels is taken back. Unless the gyro turned the other way, the heading's variance grows by the
 * square of it.
 *
 * A bias that steps turns the estimated heading, and a robot that holds its heading turns itself. The wheels then turn
 * it on the spot, steadily, by 0.01 to 0.2 rad/s, and the gyro sees less than a quarter of that. After
 * OMNI_GYRO_CREEP_SECONDS the rest is taken for bias. The heading is put back, and its variance grows in the same way.
 */
#ifndef OMNI_GYRO_H
#define OMNI_GYRO_H

#include "omni/pose_ekf.h"
#include "omni/types.h"

enum {
    OMNI_GYRO_HOLD_TICKS = 20,     /**< ticks that a reading is held for, when no newer one comes */
    OMNI_GYRO_GOOD_SAMPLES = 100,  /**< good readings in a row before it is used */
    OMNI_GYRO_STUCK_SAMPLES = 100, /**< equal readings in a row that no gyro's noise allows */
    OMNI_GYRO_REST_TICKS = 100,    /**< ticks without a count after which the robot is at rest */
    OMNI_GYRO_ANEW_TICKS = 30000,  /**< ticks with still wheels and a turning gyro after which that is its bias */
    OMNI_GYRO_WINDOWS = 3,         /**< in a row in which it contradicts the wheels */
    OMNI_GYRO_CREEP_SECONDS = 10,  /**< in which a robot turns itself steadily on the spot, unseen by the gyro */
    OMNI_GYRO_TOLD_TICKS = 5000    /**< for which a bias that has stepped is told */
};

typedef struct omni_gyro_config_t {
    int8_t axis;             /**< of the chip, that points up: 1 x, 2 y, 3 z; negative: down; 0: no gyro */
    omni_real_t scale;       /**< true rate over reading */
    omni_real_t range_rad_s; /**< a reading of this or more is saturated */
} omni_gyro_config_t;

/** What a tick is told. */
typedef struct omni_gyro_tick_t {
    uint64_t time_us;           /**< robot clock */
    const omni_real_t *reading; /**< about the chip's x, y, z [rad/s]; any value */
    uint8_t valid;              /**< bit per axis: new in this tick */
    bool timed;                 /**< the tick came in time: `duration_s` is right */
    omni_real_t duration_s;
    omni_real_t wheels_rad_s; /**< turn rate that the wheels say, without slip */
    omni_real_t wheels_x_m_s; /**< speed of the body that they say, in its frame */
    omni_real_t wheels_y_m_s;
    omni_flag_t still;  /**< no wheel has moved by a count in this tick */
    omni_flag_t driven; /**< a motor has a voltage */
} omni_gyro_tick_t;

/** What it keeps from tick to tick. All zero: never used. */
typedef struct omni_gyro_state_t {
    uint64_t time_us;  /**< of the last tick */
    omni_real_t scale; /**< configuration of that tick */
    int8_t axis;
    bool ready;                  /**< the bias has been learned */
    bool trouble;                /**< readings are missing or cannot be true */
    bool rejected;               /**< it contradicts the wheels */
    omni_uint_t proven;          /**< 1: it has agreed with the wheels over a window */
    omni_uint_t wrong_windows;   /**< in a row in which it has not */
    omni_real_t reading;         /**< the newest */
    omni_real_t rate_rad_s;      /**< of the newest good one, about the vertical axis, counter-clockwise */
    uint16_t silent_ticks;       /**< since the last reading */
    uint16_t good_samples;       /**< in a row */
    omni_uint_t same_samples;    /**< in a row that were equal */
    omni_uint_t still_ticks;     /**< in a row without a count */
    omni_uint_t rest_ticks;      /**< the same, and the gyro was quiet */
    omni_real_t window_rad;      /**< turn of the wheels over which the gyro is compared with them */
    omni_real_t turned_rad;      /**< by the wheels so far, whatever the way */
    omni_real_t same_rad;        /**< by the gyro, the wheels' way */
    omni_real_t seen_rad;        /**< by the gyro, whatever the way */
    omni_real_t apart_rad;       /**< by the gyro, beyond what the wheels say */
    omni_real_t apart_s;         /**< for how long it led meanwhile */
    omni_real_t hold_wheels_rad; /**< turn of the wheels in this second, with its sign */
    omni_real_t hold_before_rad; /**< in the second before */
    omni_real_t hold_gyro_rad;   /**< turn of the gyro in this second */
    omni_real_t hold_x_m;        /**< way of the body in this second, in its frame */
    omni_real_t hold_y_m;
    omni_real_t hold_s;       /**< for how long it led in this second */
    uint64_t hold_end_us;     /**< end of this second */
    omni_uint_t hold_seconds; /**< in a row in which the robot turned itself unseen */
    omni_real_t creep_rad;    /**< what gyro and wheels were apart in them */
    omni_real_t creep_s;      /**< how long they lasted */
    omni_uint_t told_ticks;   /**< for which a step of the bias is still told */
    omni_ekf_turn_t turn;     /**< of this tick, for the pose EKF */
} omni_gyro_state_t;

/**
 * One tick, before omni_pose_ekf_predict_turn, which takes `state->turn`. A new gyro's bias starts in `ekf`. The
 * heading is turned back if the gyro proves wrong.
 * @return false while the readings cannot be used, and for a while after the bias has stepped.
 */
bool omni_gyro_step(omni_gyro_state_t *state, const omni_gyro_config_t *config, const omni_gyro_tick_t *tick,
                    omni_pose_ekf_state_t *ekf, const omni_pose_ekf_config_t *ekf_config, const omni_kinematics_t *k);

#endif
