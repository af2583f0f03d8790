/* SPDX-License-Identifier: MIT */
/**
 * @file outside.h External world: another simulator has motors, wheels, body and floor. A hil_world_t between it and
 * the robot simulates the electronics only: PWM chip, bridges, encoder counters, pose sensor, and their faults. Its
 * plant never moves; hil_world_step() is not called.
 */
#ifndef HIL_SIM_EXTERNAL_H
#define HIL_SIM_EXTERNAL_H

#include "hil_sim/world.h"

/** State of the external simulator at one time. Arrays per wheel have HIL_MAX_WHEELS entries. */
typedef struct hil_external_state_t {
    double pose[3];                     /**< truth; theta not wrapped */
    double twist[3];                    /**< truth, world frame */
    double edges[HIL_MAX_WHEELS];       /**< encoder edges since the start, whole numbers; rise counter-clockwise */
    double wheel_rad_s[HIL_MAX_WHEELS]; /**< NaN: not available */
    double current_A[HIL_MAX_WHEELS];   /**< NaN: not available */
    double supply_V;                    /**< 0: not measured */
    bool has_fix;                       /**< a pose fix arrives now */
    uint64_t fix_taken_us;
    double fix[3];
} hil_external_state_t;

/** Start at time 0 with this state. */
void hil_external_start(hil_world_t *electronics, const hil_external_state_t *outside);

/** Update the electronics with the state after a step of `step_us` of the external simulator. */
void hil_external_update(hil_world_t *electronics, const hil_external_state_t *outside, uint32_t step_us);

/**
 * Get the bridges' outputs for the next step. A disconnected motor (fault) coasts.
 * @param duty out: mean voltage over the supply, -1..1, positive: counter-clockwise.
 * @param coast out: fraction of a PWM period with an open winding, 0..1; the rest brakes (shorted winding).
 */
void hil_external_get_drive(hil_world_t *electronics, double *duty, double *coast);

#endif
