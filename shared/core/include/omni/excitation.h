/* SPDX-License-Identifier: MIT */
/**
 * @file excitation.h
 * A signal that the robot makes in its own tick and adds to one place of its control loop. Experiments use it to see
 * how the loop answers. A wheel's wanted speed may step or sweep, its voltage may be pushed, and the wanted pose may
 * step.
 *
 * Why on the robot: set-points over a link come late, come 20 times a second, and are limited in their acceleration.
 *
 *   step    s(n) = amplitude
 *   sweep   s(n) = amplitude sin(phi(n)),  phi(n+1) = phi(n) + step(n),  step(n+1) = step(n) + rise
 *
 * with phi(0) = 0, for n = 0 ... ticks - 1. What follows in the loop limits it as it limits everything: LIM_WHEEL
 * scales wanted speeds, LIM_DUTY and the supply bound the voltages.
 *
 * It ends by itself. It ends earlier, for good, in the tick in which the robot is no longer armed or is told to hold.
 * Another kind of set-point and another position controller end it, too.
 */
#ifndef OMNI_EXCITATION_H
#define OMNI_EXCITATION_H

#include "omni/types.h"

enum { OMNI_EXCITATION_MAX_TICKS = 120000 /**< two minutes */ };

/** Where it is added, and what the robot must be doing. */
typedef enum omni_excitation_place_t {
    OMNI_EXCITATION_NONE = 0,
    OMNI_EXCITATION_WHEEL,   /**< wanted speed of a wheel [rad/s]; with velocity set-points */
    OMNI_EXCITATION_VOLTAGE, /**< voltage of a wheel [V]; not with open-loop duties */
    OMNI_EXCITATION_POSE,    /**< reference's pose in the world [m or rad], not its rate; held or by pose set-points */
    OMNI_EXCITATION_COUNT
} omni_excitation_place_t;

/** What to add. */
typedef struct omni_excitation_t {
    uint8_t place;         /**< omni_excitation_place_t */
    uint8_t index;         /**< wheel, OMNI_MAX_WHEELS: all of them alike; of a pose: 0 x, 1 y, 2 theta */
    uint32_t ticks;        /**< how long, 1 ... OMNI_EXCITATION_MAX_TICKS */
    omni_real_t amplitude; /**< in the place's unit */
    omni_real_t step_rad;  /**< phase of the first tick, 0 <= step <= pi; 0 with no rise: a step, no sweep */
    omni_real_t rise_rad;  /**< how much more phase each tick has than the one before */
} omni_excitation_t;

/** An excitation under way. All zero: there is none. */
typedef struct omni_exciter_t {
    omni_excitation_t plan;
    uint32_t left;         /**< ticks; 0: off */
    bool begun;            /**< `kind` and `controller` are those of its first tick */
    uint8_t kind;          /**< omni_setpoint_kind_t */
    uint8_t controller;    /**< enum omni_ctl_mode */
    omni_real_t phase_rad; /**< -pi ... pi */
    omni_real_t step_rad;
    omni_real_t value; /**< of this tick */
} omni_exciter_t;

/**
 * Begin with the next tick, in place of one that is under way.
 * @param wheels of the robot. @return OMNI_ERR_RANGE or OMNI_ERR_NOT_FINITE for a plan beyond what is said above; none
 * goes on then.
 */
omni_result_t omni_excitation_start(omni_exciter_t *exciter, const omni_excitation_t *plan, uint8_t wheels);

/** Compute the value of the next tick, while an excitation is under way (`left` > 0). */
void omni_excitation_next(omni_exciter_t *exciter);

#endif
