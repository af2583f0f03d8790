/* SPDX-License-Identifier: MIT */
/** @file robot_internal.h  The stages of omni_robot_tick, one file each. */
#ifndef OMNI_ROBOT_INTERNAL_H
#define OMNI_ROBOT_INTERNAL_H

#include "omni/robot.h"

/** What the stages of one tick hand to each other. */
typedef struct omni_tick_t {
    const omni_inputs_t *in;
    omni_outputs_t *out;
    omni_uint_t faults;                       /**< omni_fault_t bits found so far */
    uint32_t steps;                           /**< tick periods since the last tick, 0 on the first */
    omni_int_t delta_counts[OMNI_MAX_WHEELS]; /**< in the wheel's direction */
    omni_real_t body_wheel[OMNI_MAX_WHEELS];  /**< wanted wheel speed, rad/s */
    omni_real_t acceleration[OMNI_MAX_WHEELS];
    omni_rotation_t heading; /**< of the estimated pose */
    uint8_t kind;            /**< omni_setpoint_kind_t in force */
    bool fix_is_fresh;       /**< a pose fix has been accepted within FIX_TIMEOUT */
    bool position_loop;      /**< a pose reference is being tracked */
    omni_twist_t body_rate;  /**< velocity demand, body frame (velocity set-points) */
} omni_tick_t;

/** Time, counts, filters, pose: fills the estimates of `out`. */
void omni_robot_estimate(omni_robot_t *robot, omni_tick_t *tick);

/** Seconds from `since_us` to `now_us`; 0 for a stamp from the future, at most 4295 s. */
omni_real_t omni_robot_age_s(uint64_t now_us, uint64_t since_us);

/** Stop faults and warnings from inputs and estimates. */
void omni_robot_supervise(omni_robot_t *robot, omni_tick_t *tick);

/** Events and faults through the safety table. */
void omni_robot_transition(omni_robot_t *robot, omni_tick_t *tick);

/** The set-point in force and its reference for this tick. */
void omni_robot_reference(omni_robot_t *robot, omni_tick_t *tick);

/** Reference to duties. */
void omni_robot_control(omni_robot_t *robot, omni_tick_t *tick);

/** Does the ISMC's k cover the slip error that may be there (condition 44)? */
void omni_robot_gain_margin(omni_robot_t *robot, omni_tick_t *tick);

#endif
