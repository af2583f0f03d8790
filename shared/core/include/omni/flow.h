/* SPDX-License-Identifier: MIT */
/**
 * @file flow.h
 * A sensor of motion over the floor: its readings correct the pose EKF, or are left out.
 *
 * It may be an optical sensor, or wheels that only measure. A reading says how far a point of the body has moved since
 * the reading before, in the sensor's axes. It may say how far the body has turned, too:
 *
 *   z_xy = scale R(angle) reading_xy        in body axes, of mid-way [m]
 *   z_th = reading_turn                     counter-clockwise [rad]
 *
 * The wheels predict the same from the pose EKF's history. What the two differ by corrects slip ratios and pose
 * (omni/pose_ekf.h). A reading replaces nothing.
 *
 * Bits 0 to 2 of `valid` say that x, y and the turn are good. Bit 3 says that a reading came, good or not: the next one
 * counts from here. So a drop-out is bit 3 alone. A reading without bit 3 is not looked at.
 *
 * Left out is a reading that is not finite, or larger than any robot moves meanwhile. So is one that does not fit: its
 * normalised innovation squared is beyond the gate. After OMNI_FLOW_DOUBT of these in a row the floor may have changed.
 * The slip ratios count as unknown then, if the ways differ by less than half. So they do once more every
 * OMNI_FLOW_AGAIN readings. A sensor that has never been used must point right for that, see below.
 *
 * It is silent after OMNI_FLOW_HOLD_TICKS without a good reading, until one comes. It is in trouble after
 * OMNI_FLOW_REFUSED that do not fit, or if most of its last readings do not. So it is while it says exactly zero
 * and the wheels have moved by more than 20 mm. It may also repeat itself: the same reading, not zero,
 * OMNI_FLOW_REPEATS times. If the wheels say another way by then, by 1 mm and a tenth of it, that is trouble, too.
 * Their slip is left out of this comparison, or it would hide that. The wheels count alone then, until
 * OMNI_FLOW_GOOD readings of a robot that moves fit in a row. A sensor that was silent must prove itself in the
 * same way before it counts.
 *
 * Wheels that spin, or slide, are no slip that a ratio could say. A sensor that has been right is then believed, and
 * the wheels are not: it leads. It must be known to point right, see below, and have fitted OMNI_FLOW_LEAD times over
 * ways far beyond its noise. A reading whose speed differs from the one before by more than OMNI_FLOW_MOST_M_S2 is left
 * out, and it must fit as often anew. One that leads counts as one that does not fit, but for "in trouble": that comes
 * after OMNI_FLOW_LED of them. Five in a row that fit end this.
 *
 * A sensor that points elsewhere is taken for slip. But slip makes ways shorter and longer, and does not turn them:
 * B+ diag(s) B is symmetric in x and y. (So it is for wheels that stand evenly.) Let d be the ways of the wheels
 * without slip. Let z = A d hold in least squares over the last ways of about 2 m. Then the direction is off by
 *
 *   psi = atan2(A_yx - A_xy, A_xx + A_yy)
 *
 * It is known once the robot has moved in two directions, and by more than noise. A wheel that spins turns the way,
 * too, but it also changes the turn of the body, or the way's length. So readings where that is much are left out. Of
 * those that lead, only ones where it is little count, after OMNI_FLOW_ODD in a row. Beyond 0.15 rad the sensor is in
 * trouble, until psi is below 0.075 rad. (While it leads, and the turn is not measured by it, beyond 0.25 rad.) What it
 * has taught is then taken back. That is the slip ratios, and how far its readings have moved the pose. This goes back
 * by about 2 m of way, and to the last pose fix at most. The same is done if it does not fit within the first 2 m of
 * its use.
 */
#ifndef OMNI_FLOW_H
#define OMNI_FLOW_H

#include "omni/pose_ekf.h"
#include "omni/types.h"

enum {
    OMNI_FLOW_HOLD_TICKS = 200, /**< ticks without a good reading after which it counts as silent */
    OMNI_FLOW_GOOD = 5,         /**< readings in a row that fit before it is used; the robot must move */
    OMNI_FLOW_DOUBT = 10,       /**< refused ones in a row after which the slip ratios count as unknown, */
    OMNI_FLOW_AGAIN = 50,       /**< and again after so many */
    OMNI_FLOW_REFUSED = 20,     /**< refused ones in a row after which it is in trouble */
    OMNI_FLOW_REPEATS = 5,      /**< equal ones in a row that may be those of a sensor that has hung up */
    OMNI_FLOW_LEAD = 20,        /**< that fitted before it is believed against the wheels */
    OMNI_FLOW_LED = 500,        /**< most for which it is, */
    OMNI_FLOW_ODD = 25          /**< of them in a row, as if it pointed elsewhere, before they tell where */
};

#define OMNI_FLOW_MOST_M_S2 8.0f /**< wheels on a floor speed up and brake no faster, m/s^2 */

/** Bits of omni_flow_tick_t::valid. */
enum { OMNI_FLOW_XY = 3, OMNI_FLOW_TURN = 4, OMNI_FLOW_READ = 8 };

typedef struct omni_flow_config_t {
    uint8_t axes;         /**< 0: no sensor; 2: it measures x and y; 3: and the turn */
    omni_real_t cosine;   /**< of its x axis, seen from the body's */
    omni_real_t sine;     /**< the same */
    omni_real_t scale;    /**< true way over reading */
    omni_real_t arm_m[2]; /**< where it is, body frame */
    omni_real_t r_xy;     /**< variance of x and of y of a reading, m^2 */
    omni_real_t r_share;  /**< the same as a share of the way squared, added */
    omni_real_t r_turn;   /**< rad^2 */
    uint32_t delay_us;    /**< from the end of what it measures to the tick that gets it */
} omni_flow_config_t;

/** What a tick is told. */
typedef struct omni_flow_tick_t {
    uint64_t time_us;           /**< robot clock */
    const omni_real_t *reading; /**< x, y [m], turn [rad] since the reading before; any value */
    uint8_t valid;              /**< bits, see above */
    bool timed;                 /**< the tick came in time */
} omni_flow_tick_t;

/** What it keeps from tick to tick. All zero: never used. */
typedef struct omni_flow_state_t {
    uint64_t time_us;           /**< of the last tick */
    omni_flow_config_t config;  /**< of that tick */
    uint64_t read_us;           /**< tick of the last reading, good or not; 0: none */
    uint64_t good_us;           /**< of the last good one, or when it began */
    omni_flag_t trouble;        /**< readings do not fit, or hang, or it points elsewhere */
    omni_flag_t silent;         /**< readings are missing, or cannot be true */
    omni_flag_t trusted;        /**< it has proved itself since it was last in trouble or silent */
    omni_uint_t good;           /**< readings in a row that fitted while the robot moved */
    omni_uint_t refused_in_row; /**< that did not fit */
    omni_uint_t used;           /**< readings so far */
    omni_uint_t refused;
    omni_uint_t unfit_in_row; /**< the same, with those that led */
    omni_uint_t long_fits;    /**< that fitted since it was last in trouble, over ways far beyond its noise */
    omni_uint_t led;          /**< that counted in the wheels' place; each that fits takes one off */
    omni_uint_t odd_in_row;   /**< those of them in a row that are as if the sensor pointed elsewhere */
    omni_flag_t odd;          /**< so is the last reading */
    omni_flag_t tells;        /**< it says something of where the sensor points: no wheel spins or slides */
    omni_flag_t leads;        /**< the last one led, and five in a row have not fitted since */
    omni_flag_t right;        /**< it has been known to point right since it was last in trouble */
    uint64_t pace_us;         /**< tick of the last reading that can be true */
    omni_real_t pace_m_s[2];  /**< its speed, body axes */
    omni_real_t still_m[2];   /**< way of the wheels beyond it, along each axis on which it has said nothing since */
    omni_real_t
        led_way[OMNI_AXES];       /**< how far those that led have moved the pose beyond the wheels: world, m, m, rad */
    omni_real_t sum[OMNI_AXES];   /**< readings so far that can be true, in body axes: m, m, rad */
    omni_real_t zero_m[2];        /**< way of the wheels over which it said nothing but zero, body axes added up */
    omni_real_t nis;              /**< normalised innovation squared of the last reading */
    omni_real_t last[2];          /**< x and y of the last reading that can be true */
    omni_uint_t repeats;          /**< readings in a row that were the same as the one before, and not zero */
    omni_real_t rolled_m[2];      /**< what the wheels said at the first of them, without slip */
    omni_flag_t frozen;           /**< they repeat themselves, and the wheels say another way by now */
    omni_uint_t came;             /**< readings so far, good or not */
    omni_uint_t lost;             /**< those that came without a way */
    omni_real_t refused_share;    /**< of the last ones, about fifty: those that did not fit */
    omni_real_t way_m;            /**< over which the following sums reach back */
    omni_real_t wheels_m2[3];     /**< of d_x d_x, d_x d_y, d_y d_y */
    omni_real_t both_m2[2][2];    /**< of z d^T */
    omni_real_t led_m;            /**< way of readings without a turn that led, of the last 2 m */
    omni_flag_t knows;            /**< the direction is known */
    omni_flag_t askew;            /**< it is wrong, or was when it was last known */
    omni_real_t off_rad;          /**< psi above; 0 while it is not known */
    omni_real_t taken[OMNI_AXES]; /**< how far readings have moved the pose over the same way: world, m, m, rad */
    omni_uint_t fixes;            /**< pose fixes used until then */
    omni_real_t counted_m;        /**< way over which readings have been used since anything was taken back */
} omni_flow_state_t;

/** One tick, after the pose EKF's prediction. @return false while the readings cannot be used. */
omni_flag_t omni_flow_step(omni_flow_state_t *state, const omni_flow_config_t *config, const omni_flow_tick_t *tick,
                           omni_pose_ekf_state_t *ekf, const omni_pose_ekf_config_t *ekf_config,
                           const omni_kinematics_t *k);

#endif
