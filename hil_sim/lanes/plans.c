/* SPDX-License-Identifier: MIT */
#include "plans.h"

#include <string.h>

#include "omni/trajectory.h"

void hil_lanes_plans_set(hil_lanes_plans_t *plans, const void *const plan[HIL_LANES]) {
    memcpy(plans->plan, plan, sizeof plans->plan);
    plans->same = true;
    for (int lane = 1; lane < HIL_LANES; ++lane) {
        plans->same = plans->same && memcmp(plan[lane], plan[0], sizeof(omni_trajectory_t)) == 0;
    }
}

void hil_lanes_plans_evaluate(const hil_lanes_plans_t *plans, uint64_t time_us, const hil_layout_t *layout, void *reference) {
    omni_reference_t each[HIL_LANES];
    const void *from[HIL_LANES];
    const int evaluated = plans->same ? 1 : HIL_LANES;
    for (int lane = 0; lane < HIL_LANES; ++lane) {
        if (lane < evaluated) {
            omni_trajectory_evaluate((const omni_trajectory_t *)plans->plan[lane], time_us, &each[lane]);
        }
        from[lane] = &each[lane < evaluated ? lane : 0];
    }
    (void)hil_lanes_pack(layout, from, reference); /* it has nothing that is common to all runs */
}
