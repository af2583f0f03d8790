/* SPDX-License-Identifier: MIT */
#include "plans.h"

#include <string.h>

#include "omni/trajectory.h"

void hil_lanes_plans_set(hil_lanes_plans_t *plans, const void *const plan[HIL_LANES]) {
    memcpy(plans->plan, plan, sizeof plans->plan);
    plans->packed = false;
}

void hil_lanes_plans_evaluate(const hil_lanes_plans_t *plans, uint64_t time_us, const hil_layout_t *layout, void *reference) {
    omni_reference_t each[HIL_LANES];
    const void *from[HIL_LANES];
    for (int lane = 0; lane < HIL_LANES; ++lane) {
        omni_trajectory_evaluate((const omni_trajectory_t *)plans->plan[lane], time_us, &each[lane]);
        from[lane] = &each[lane];
    }
    (void)hil_lanes_pack(layout, from, reference); /* it has nothing that is common to all runs */
}
