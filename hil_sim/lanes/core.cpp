// SPDX-License-Identifier: MIT
// The control core for eight runs at once: the rest of its very sources. Left out is what no tick calls: planning,
// building configurations, parameters, duties as PWM counts; and trajectories, which each run evaluates for itself.
//
// Its invariants are not checked here. A tick in which the runs part is computed again for each of them, and what this
// copy made of it means nothing. A run alone goes through the other copy, where they are checked.
#undef OMNI_ASSERTS
#include "core.h"

#include "divergence.h"
#include "filters.hpp"
#include "plans.h"

namespace {
namespace core {

#define omni_trajectory_evaluate evaluate_together
#include "reference/trajectory.c"
#undef omni_trajectory_evaluate

#include "lanes_sources_gen.h"

/* `plan` stands for eight plans. Where they part, on the way from one phase of a path to the next, each run evaluates
 * for itself. */
void omni_trajectory_evaluate(const omni_trajectory_t *plan, uint64_t time_us, omni_reference_t *reference) {
    const auto *plans = reinterpret_cast<const hil_lanes_plans_t *>(plan);
    if (plans->packed && !hil_lanes_plans_are_one(plans, time_us)) {
        const bool before = hil_lanes_take_diverged();
        evaluate_together(reinterpret_cast<const omni_trajectory_t *>(plans->lanes), time_us, reference);
        const bool parted = hil_lanes_take_diverged();
        if (before) {
            hil_lanes_diverge();
        }
        if (!parted) {
            return;
        }
    }
    hil_lanes_plans_evaluate(plans, time_us, &layout_omni_reference_t, reference);
}

static_assert(sizeof(omni_trajectory_t) <= HIL_LANES_PLAN_BYTES);

const omni_trajectory_t *packed(hil_lanes_plans_t *plans) {
    if (plans != nullptr) {
        plans->packed = hil_lanes_pack(&layout_omni_trajectory_t, plans->plan, plans->lanes);
    }
    return reinterpret_cast<const omni_trajectory_t *>(plans);
}

void tick(void *robot, const void *inputs, void *outputs) {
    omni_robot_tick(static_cast<omni_robot_t *>(robot), static_cast<const omni_inputs_t *>(inputs),
                    static_cast<omni_outputs_t *>(outputs));
}

void connect(void *robot, const void *config, hil_lanes_plans_t *plans) {
    auto *lanes = static_cast<omni_robot_t *>(robot);
    lanes->config = static_cast<const omni_robot_config_t *>(config);
    lanes->reference_generator.trajectory = packed(plans);
}

const hil_lanes_plans_t *plans_of(const void *robot) {
    return reinterpret_cast<const hil_lanes_plans_t *>(
        static_cast<const omni_robot_t *>(robot)->reference_generator.trajectory);
}

void offer(void *inputs, hil_lanes_plans_t *plans) {
    static_cast<omni_inputs_t *>(inputs)->trajectory = packed(plans);
}

} // namespace core
} // namespace

#define LANES_NAME_OF(level) hil_lanes_core_##level
#define LANES_NAME(level) LANES_NAME_OF(level)

extern "C" const hil_lanes_core_t LANES_NAME(OMNI_LANES_LEVEL) = {
    sizeof(core::omni_robot_t),
    sizeof(core::omni_robot_config_t),
    sizeof(core::omni_inputs_t),
    sizeof(core::omni_outputs_t),
    core::layout_omni_robot_t,
    core::layout_omni_robot_config_t,
    core::layout_omni_inputs_t,
    core::layout_omni_outputs_t,
    core::tick,
    core::connect,
    core::plans_of,
    core::offer,
};
