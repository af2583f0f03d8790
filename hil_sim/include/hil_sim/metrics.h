/* SPDX-License-Identifier: MIT */
/**
 * @file metrics.h
 * Metrics of a run accumulated tick by tick, equal to those of metrics.py from a record. Why: thousands of runs need no
 * records. figures.h derives the figures.
 */
#ifndef HIL_SIM_METRICS_H
#define HIL_SIM_METRICS_H

#include "hil_sim/milestones.h"
#include "hil_sim/real.h"
#include "hil_sim/world.h"
#include "omni/robot.h"

/**
 * Sums over the ticks on the path (armed, phase PATH), unless said otherwise. Errors: truth - reference, estimate -
 * truth; headings to the nearest whole turn.
 */
typedef struct hil_metrics_t {
    hil_real_t tracking_square[3]; /**< squares of x, y [m^2], theta [rad^2] */
    hil_real_t estimate_square[3];
    hil_real_t distance_square_max; /**< largest square of the tracking error's distance [m^2] */
    hil_real_t turn_max;            /**< largest tracking error of the heading [rad] */
    hil_real_t wheel_peak;          /**< largest true wheel speed [rad/s] */
    hil_real_t duty_peak;
    hil_real_t duty_sum; /**< of absolute values, over the wheels */
    hil_real_t duty_square;
    hil_real_t duty_change; /**< absolute, from one of these ticks to the next, over the wheels */
    hil_real_t duty_last[HIL_MAX_WHEELS];
    hil_real_t cut_ticks;      /**< ticks with saturated wheel speeds or voltages */
    hil_real_t nis;            /**< normalised innovation squared, of the accepted fixes */
    hil_real_t fixes;          /**< how many those were */
    hil_real_t fixes_last;     /**< omni_outputs_t.fixes_accepted of the last tick */
    hil_real_t final_error[3]; /**< tracking error of the last tick on the path or after its end, armed */
    hil_time_t path_ticks;     /**< ticks on the path */
    omni_uint_t faults;        /**< omni_fault_t bits seen since arming; of all ticks if it never was armed */
    hil_milestones_t milestones;
} hil_metrics_t;

void hil_metrics_init(hil_metrics_t *metrics);

/** Add a tick: after the robot's tick, before the world's step, like rows of a record. */
void hil_metrics_tick(hil_metrics_t *metrics, const hil_world_t *world, const omni_outputs_t *outputs);

#endif
