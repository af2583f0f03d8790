/* SPDX-License-Identifier: MIT */
/**
 * @file figures.h
 * Figures of merit of a run: one row of numbers.
 */
#ifndef HIL_SIM_FIGURES_H
#define HIL_SIM_FIGURES_H

#include "hil_sim/metrics.h"

/**
 * Tracking (truth - reference), estimate (estimate - truth) and effort are those of the path: armed, phase PATH; NaN if
 * there was no such tick. Members before `completed` identify the run.
 */
typedef struct hil_figures_t {
    uint64_t seed;
    uint64_t ticks;             /**< run, with the 100 after the final disarm */
    uint32_t status;            /**< hil_run_status_t */
    uint32_t faults;            /**< omni_fault_t bits seen since arming; of a run that could not start: the cause */
    double completed;           /**< 1: the trajectory was driven to its end, 0: not */
    double x_m;                 /**< root mean square of the tracking error */
    double y_m;                 /**< likewise */
    double theta_rad;           /**< likewise */
    double position_m;          /**< sqrt(x_m^2 + y_m^2) */
    double max_position_m;      /**< largest distance between truth and reference */
    double max_theta_rad;       /**< largest heading error */
    double final_position_m;    /**< distance at the last armed tick on the path or after its end */
    double final_theta_rad;     /**< heading error there, absolute */
    double estimate_x_m;        /**< root mean square of the estimate's error */
    double estimate_y_m;        /**< likewise */
    double estimate_theta_rad;  /**< likewise */
    double estimate_position_m; /**< sqrt(estimate_x_m^2 + estimate_y_m^2) */
    double nis;              /**< mean normalised innovation squared of the accepted fixes; 3 for a consistent filter */
    double peak_wheel_rad_s; /**< fastest true wheel speed */
    double peak_duty;        /**< largest duty, 0..1 */
    double rms_duty;         /**< root mean square of all wheels' duties */
    double saturated_share;  /**< fraction of ticks with saturated wheel speeds or voltages */
    double chatter;          /**< mean change of a duty from tick to tick over the mean duty, both absolute */
} hil_figures_t;

/** Compute the figures from metrics; seed, ticks and status are not changed. */
void hil_figures_from_metrics(hil_figures_t *figures, const hil_metrics_t *metrics, uint32_t wheels);

#endif
