/* SPDX-License-Identifier: MIT */
/**
 * @file plans.h
 * Trajectories in lanes. Each run has its own plan, and its reference comes from the core's ordinary functions, plan by plan; a pointer to
 * this is what stands in `trajectory` of robot and inputs in lanes.
 */
#ifndef HIL_LANES_PLANS_H
#define HIL_LANES_PLANS_H

#include "pack.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct hil_lanes_plans_t {
    const void *plan[HIL_LANES]; /**< omni_trajectory_t of each run */
    uint8_t same[HIL_LANES];     /**< first run with the same plan */
    uint8_t path[HIL_LANES];     /**< first run whose plan differs at most in the way to the path's start */
} hil_lanes_plans_t;

/** Take over eight plans. */
void hil_lanes_plans_set(hil_lanes_plans_t *plans, const void *const plan[HIL_LANES]);

/** omni_trajectory_evaluate for each run. @param reference out: omni_reference_t in lanes, with its layout. */
void hil_lanes_plans_evaluate(const hil_lanes_plans_t *plans, uint64_t time_us, const hil_layout_t *layout, void *reference);

#ifdef __cplusplus
}
#endif

#endif
