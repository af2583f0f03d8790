/* SPDX-License-Identifier: MIT */
/**
 * @file excitation.h
 * Excitation signal for system identification and loop tuning: a step or a linear sine sweep (chirp), generated in the
 * tick and added at one point of the control loop: wheel speed setpoint, wheel voltage, or pose reference.
 *
 * Why on the robot: setpoints over a link are delayed, arrive at 20 Hz, and are limited in their acceleration.
 *
 *   step    s(n) = amplitude
 *   sweep   s(n) = amplitude sin(phi(n)),  phi(n+1) = phi(n) + step(n),  step(n+1) = step(n) + acc
 *
 * with phi(0) = 0, for n = 0 ... ticks - 1. The limits of the loop still apply: LIM_WHEEL to wheel speeds, LIM_DUTY and
 * the supply to voltages.
 *
 * It ends after `ticks`, and earlier when the robot is disarmed or told to hold, or when the kind of setpoint or the
 * position controller changes.
 */
#ifndef OMNI_EXCITATION_H
#define OMNI_EXCITATION_H

#include "omni/types.h"

enum { OMNI_EXCITATION_MAX_TICKS = 120000 /**< two minutes */ };

/** Point of the loop where it is added, and the setpoints that are allowed with it. */
typedef enum omni_excitation_place_t {
    OMNI_EXCITATION_NONE = 0,
    OMNI_EXCITATION_WHEEL,   /**< speed setpoint of a wheel [rad/s]; with velocity setpoints */
    OMNI_EXCITATION_VOLTAGE, /**< voltage of a wheel [V]; not with open-loop duty setpoints */
    OMNI_EXCITATION_POSE,    /**< pose reference, world frame [m or rad], not its rate; holding, or pose setpoints */
    OMNI_EXCITATION_COUNT
} omni_excitation_place_t;

/** Definition of the signal. */
typedef struct omni_excitation_t {
    uint8_t place;         /**< omni_excitation_place_t */
    uint8_t index;         /**< wheel, or OMNI_MAX_WHEELS: all wheels; of a pose: 0 x, 1 y, 2 theta */
    uint32_t ticks;        /**< duration, 1 ... OMNI_EXCITATION_MAX_TICKS */
    omni_real_t amplitude; /**< in the unit of `place` */
    omni_real_t step_rad;  /**< step(0): phase increment of the first tick, 0..pi; 0 with acc = 0: a step */
    omni_real_t phase_acceleration_rad; /**< acc: change of the phase increment per tick */
} omni_excitation_t;

/** State of the running excitation. All zero: none. */
typedef struct omni_excitation_state_t {
    omni_excitation_t plan;
    uint32_t ticks_left;   /**< 0: off */
    bool started;          /**< `kind` and `controller` of its first tick are set */
    uint8_t kind;          /**< omni_setpoint_kind_t */
    uint8_t controller;    /**< enum omni_ctl_mode */
    omni_real_t phase_rad; /**< -pi ... pi */
    omni_real_t step_rad;
    omni_real_t value; /**< added in this tick */
} omni_excitation_state_t;

/**
 * Start with the next tick; replaces a running excitation.
 * @param wheels number of wheels. @return OMNI_ERR_RANGE or OMNI_ERR_NOT_FINITE for a plan outside the ranges above;
 * then none is running.
 */
omni_result_t omni_excitation_start(omni_excitation_state_t *exciter, const omni_excitation_t *plan, uint8_t wheels);

/** Compute the value of the next tick. Only while an excitation is running (`ticks_left` > 0). */
void omni_excitation_next(omni_excitation_state_t *exciter);

#endif
