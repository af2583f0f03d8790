/* SPDX-License-Identifier: MIT */
/**
 * @file plans.h
 * Trajectories in lanes. Each run has its own plan; a pointer to this is what stands in `trajectory` of robot and
 * inputs in lanes. As far as the plans take the same way they are evaluated together, else one by one by the core's
 * ordinary functions.
 */
#ifndef HIL_LANES_PLANS_H
#define HIL_LANES_PLANS_H

#include "pack.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { HIL_LANES_PLAN_BYTES = 6144 };

typedef struct hil_lanes_plans_t {
    __attribute__((aligned(64))) char lanes[HIL_LANES_PLAN_BYTES]; /**< omni_trajectory_t in lanes */
    const void *plan[HIL_LANES];                                   /**< omni_trajectory_t of each run */
    uint8_t same[HIL_LANES];                                       /**< first run with the same plan */
    uint8_t path[HIL_LANES]; /**< first run whose plan differs at most in the way to the path's start */
    bool packed;             /**< `lanes` is usable */
} hil_lanes_plans_t;

/** Take over eight plans. */
void hil_lanes_plans_set(hil_lanes_plans_t *plans, const void *const plan[HIL_LANES]);

/** Are all runs on one path now, so that one evaluation serves all? */
bool hil_lanes_plans_are_one(const hil_lanes_plans_t *plans, uint64_t time_us);

/** omni_trajectory_evaluate for each run. @param reference out: omni_reference_t in lanes, with its layout. */
void hil_lanes_plans_evaluate(const hil_lanes_plans_t *plans, uint64_t time_us, const hil_layout_t *layout,
                              void *reference);

#ifdef __cplusplus
}
#endif

#endif
