// SPDX-License-Identifier: MIT
// Ticks of eight runs at once: the world's very sources around the control core in lanes. Left out is what no tick
// calls: start, configurations, transactions of a bus, records.
#include "world_types.hpp"

#include "core.h"
#include "divergence.h"
#include "runs.h"

#define LANES_NAME_OF(name, level) name##level
#define LANES_NAME(name, level) LANES_NAME_OF(name, level)

namespace {
namespace core {

void omni_robot_tick(omni_robot_t *robot, const omni_inputs_t *inputs, omni_outputs_t *outputs) {
    LANES_NAME(hil_lanes_core_, OMNI_LANES_LEVEL).tick(robot, inputs, outputs);
}

#define OMNI_INLINE LANES_INLINE
#include "math/math_inline.h"
#undef OMNI_INLINE

#include "actuate/bridge.c"
#include "tick/loop.c"

#include "backlash.c"
#include "bridge_limits.c"
#include "drv8871.c"
#include "faults.c"
#include "floor.c"
#include "in_process.c"
#include "metrics.c"
#include "milestones.c"
#include "motors.c"
#include "pca9685.c"
#include "plant.c"
#include "plant_contact.c"
#include "plant_sources_gen.h"
#include "sensor_sources_gen.h"
#include "sensors.c"
#include "slip.c"
#include "world_step.c"

uint64_t advance(const hil_lanes_group_t *group, uint64_t ticks) {
    auto *world = static_cast<hil_world_t *>(group->world);
    auto *metrics = static_cast<hil_metrics_t *>(group->metrics);
    auto *robot = static_cast<omni_robot_t *>(group->robot);
    auto *inputs = static_cast<omni_inputs_t *>(group->inputs);
    auto *outputs = static_cast<omni_outputs_t *>(group->outputs);
    for (uint64_t tick = 0; tick < ticks; ++tick) {
        hil_in_process_tick(world, robot, inputs, outputs);
        hil_metrics_tick(metrics, world, outputs);
        hil_in_process_step(world);
        if (hil_lanes_take_diverged()) {
            return tick;
        }
    }
    return ticks;
}

} // namespace core
} // namespace

extern "C" const hil_lanes_runs_t LANES_NAME(hil_lanes_runs_, OMNI_LANES_LEVEL) = {
    &LANES_NAME(hil_lanes_core_, OMNI_LANES_LEVEL),
    sizeof(core::hil_world_t),
    sizeof(core::hil_metrics_t),
    core::layout_hil_world_t,
    core::layout_hil_metrics_t,
    core::advance,
};
