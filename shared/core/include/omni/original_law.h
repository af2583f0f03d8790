/* SPDX-License-Identifier: MIT */
/**
 * @file original_law.h
 * Control law of the three-wheel robot's original firmware, as a baseline for comparison: 50 Hz, pose error to wheel
 * voltages.
 *
 *   s = e + lambda * W(e);   u = -lambda e + xi'_d - K sign(s);   wheel speeds through B / r, scaled to 4 rad/s
 *   V = 10 (w_d - w) + 30 W(w_d - w), scaled to the supply
 *
 * W is the original's integral: the sum over the last 100 samples divided by 100. Wheel speed comes from counts
 * differenced over a 20 ms period; pose from dead reckoning. Its parser and wiring errors are not reproduced.
 */
#ifndef OMNI_ORIGINAL_LAW_H
#define OMNI_ORIGINAL_LAW_H

#include "omni/kinematics.h"
#include "omni/types.h"

enum {
    OMNI_ORIGINAL_WINDOW = 100,
    /** Limit of |counts per tick|, so that the sum over a period does not overflow. */
    OMNI_ORIGINAL_LARGEST_DELTA = 1000003
};

typedef struct omni_original_config_t {
    omni_real_t lambda;      /**< 14 */
    omni_real_t k;           /**< 0.01 */
    omni_real_t motor_p;     /**< 10 V s/rad */
    omni_real_t motor_i;     /**< 30 */
    omni_real_t wheel_limit; /**< 4 rad/s */
    omni_real_t rad_per_count;
    uint16_t period_ticks; /**< ticks per 20 ms period */
    omni_real_t period_s;  /**< 0.02 */
} omni_original_config_t;

typedef struct omni_original_state_t {
    omni_real_t pose_window[OMNI_AXES][OMNI_ORIGINAL_WINDOW];
    omni_real_t wheel_window[OMNI_MAX_WHEELS][OMNI_ORIGINAL_WINDOW];
    uint8_t next;                                 /**< window index of the next sample */
    uint16_t tick;                                /**< ticks since the last period began */
    omni_int_t moved_counts[OMNI_MAX_WHEELS];     /**< counts moved in this period */
    omni_real_t wheel_reference[OMNI_MAX_WHEELS]; /**< rad/s */
    omni_real_t voltage_V[OMNI_MAX_WHEELS];       /**< held over the period */
} omni_original_state_t;

/** The published constants, for a tick of step_s. */
omni_original_config_t omni_original_defaults(omni_real_t step_s, omni_real_t rad_per_count);

void omni_original_reset(omni_original_state_t *state);

/** One tick (the law itself runs every period_ticks). Results are read from `state`.
 *  @param delta_counts per wheel, |value| <= OMNI_ORIGINAL_LARGEST_DELTA. */
/*@ requires fits: \forall integer i; 0 <= i < k->wheels ==>
      -OMNI_ORIGINAL_LARGEST_DELTA <= delta_counts[i] <= OMNI_ORIGINAL_LARGEST_DELTA; */
void omni_original_step(omni_original_state_t *state, const omni_original_config_t *config, const omni_kinematics_t *k,
                        const omni_int_t *delta_counts, const omni_pose_t *pose, const omni_pose_t *reference,
                        const omni_twist_t *reference_rate, omni_real_t supply_V);

#endif
