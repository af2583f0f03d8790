/* SPDX-License-Identifier: MIT */
/**
 * @file outside.h
 * A world that is somewhere else: another simulator has motors, wheels, body and floor. A hil_world_t stays between it
 * and the robot and is the electronics alone: PWM chip, bridges, encoder counters, pose sensor, their faults. Its
 * plant never moves; hil_world_step() is not called.
 */
#ifndef HIL_SIM_OUTSIDE_H
#define HIL_SIM_OUTSIDE_H

#include "hil_sim/world.h"

/** What the other simulator says of a time. Arrays per wheel have HIL_MAX_WHEELS entries. */
typedef struct hil_outside_t {
    double pose[3];                     /**< truth; theta not wrapped */
    double twist[3];                    /**< truth, world frame */
    double edges[HIL_MAX_WHEELS];       /**< encoder edges since the start, whole numbers; rise counter-clockwise */
    double wheel_rad_s[HIL_MAX_WHEELS]; /**< NaN: not told */
    double current_A[HIL_MAX_WHEELS];   /**< NaN: not told */
    double supply_V;                    /**< 0: not measured */
    bool has_fix;                       /**< a pose fix arrives now */
    uint64_t fix_taken_us;
    double fix[3];
} hil_outside_t;

/** Begin at time 0: the electronics see this instead of their own world's start. */
void hil_outside_begin(hil_world_t *electronics, const hil_outside_t *outside);

/** The outside has made its step of `step_us`: this is what it says then. */
void hil_outside_follow(hil_world_t *electronics, const hil_outside_t *outside, uint32_t step_us);

/**
 * What the bridges do to the motors in the step that begins now. A motor that is disconnected (fault) only coasts.
 * @param duty out: share of the supply, -1..1, positive: counter-clockwise.
 * @param coast out: share of a PWM period in which the winding is open, 0..1; what is left of it shorts the winding.
 */
void hil_outside_drive(hil_world_t *electronics, double *duty, double *coast);

#endif
