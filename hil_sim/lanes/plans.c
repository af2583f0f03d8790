/* SPDX-License-Identifier: MIT */
#include "plans.h"

#include <string.h>

#include "omni/trajectory.h"

/* Bit for bit: holes that differ cost time only. */
static bool same(const void *a, const void *b) {
    return memcmp(a, b, sizeof(omni_trajectory_t)) == 0;
}

/* After the lead-in, the pose at plan time matters only to a robot that holds it. */
static bool same_path(const omni_trajectory_t *a, const omni_trajectory_t *b) {
    omni_trajectory_t moved;
    memcpy(&moved, b, sizeof moved);
    moved.origin = a->origin;
    return a->config.type != OMNI_TRJ_TYPE_HOLD && same(a, &moved);
}

void hil_lanes_plans_set(hil_lanes_plans_t *plans, const void *const plan[HIL_LANES]) {
    memcpy(plans->plan, plan, sizeof plans->plan);
    plans->packed = false;
    for (int lane = 0; lane < HIL_LANES; ++lane) {
        plans->same[lane] = plans->path[lane] = (uint8_t)lane;
        for (int i = lane; i-- > 0;) {
            plans->same[lane] = same(plan[i], plan[lane]) ? (uint8_t)i : plans->same[lane];
            plans->path[lane] = same_path(plan[i], plan[lane]) ? (uint8_t)i : plans->path[lane];
        }
    }
}

/* The first run with the same reference. */
static int like(const hil_lanes_plans_t *plans, int lane, uint64_t time_us) {
    const omni_trajectory_t *plan = plans->plan[lane];
    return time_us < plan->timing.lead_in_us ? plans->same[lane] : plans->path[lane];
}

bool hil_lanes_plans_are_one(const hil_lanes_plans_t *plans, uint64_t time_us) {
    bool one = true;
    for (int lane = 1; lane < HIL_LANES; ++lane) {
        one = one && like(plans, lane, time_us) == 0;
    }
    return one;
}

void hil_lanes_plans_evaluate(const hil_lanes_plans_t *plans, uint64_t time_us, const hil_layout_t *layout,
                              void *reference) {
    omni_reference_t each[HIL_LANES];
    const void *from[HIL_LANES];
    for (int lane = 0; lane < HIL_LANES; ++lane) {
        const int first = like(plans, lane, time_us);
        if (first == lane) {
            omni_trajectory_evaluate(plans->plan[lane], time_us, &each[lane]);
        }
        from[lane] = &each[first];
    }
    (void)hil_lanes_pack(layout, from, reference); /* it has nothing that is common to all runs */
}
