// SPDX-License-Identifier: MIT
/**
 * @file core.hpp
 * The control core for eight runs at once: the very sources of shared/core, compiled with lanes for numbers, in namespace `core` of the
 * including file. Nothing is declared twice; what may differ between the runs is in their types (omni/types.h).
 *
 * Left out is what no tick calls: planning and evaluating trajectories, building configurations, parameters, duties as PWM counts.
 */
#ifndef HIL_LANES_CORE_HPP
#define HIL_LANES_CORE_HPP

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "lanes.hpp"
#include "layout.h"
#include "plans.h"

#define OMNI_OWN_NUMBERS
#define OMNI_FABSF lanes::abs
#define OMNI_SQRTF lanes::sqrt
#define omni_select lanes::select
#define omni_all lanes::all
#define omni_any lanes::any
#define OMNI_INLINE LANES_INLINE
#define OMNI_KINEMATICS_INLINE LANES_INLINE
#define OMNI_PID_INLINE LANES_INLINE

namespace { // NOLINT(cert-dcl59-cpp): each file and CPU level has its own copy
namespace core {

typedef lanes::real_t omni_real_t;
typedef lanes::int_t omni_int_t;
typedef lanes::uint_t omni_uint_t;
typedef lanes::mask_t omni_flag_t;

#include "kinematics_inline.h"
#include "math_inline.h"
#include "pid_inline.h"

#undef OMNI_INLINE
#undef OMNI_KINEMATICS_INLINE
#undef OMNI_PID_INLINE

#include "direct_torque.c"
#include "feedback_linearization.c"
#include "ismc.c"
#include "kinematics.c"
#include "math.c"
#include "motor_kf.c"
#include "original_law.c"
#include "pid.c"
#include "pose_ekf.c"
#include "pose_ekf_correct.c"
#include "pose_ekf_history.c"
#include "robot.c"
#include "robot_control.c"
#include "robot_estimate.c"
#include "robot_margin.c"
#include "robot_reference.c"
#include "robot_supervise.c"
#include "safety.c"
#include "saturation.c"
#include "torque_curve.c"
#include "wheel_speed.c"

/* A stretch has no holes in lanes either. */
constexpr size_t stretch_bytes(hil_stretch_kind_t kind) {
    return kind == HIL_STRETCH_SAME ? 0 : kind == HIL_STRETCH_WIDE ? sizeof(lanes::wide_t) : sizeof(lanes::real_t);
}
#define LANES_CHECK(kind, type, first, last, count)                                                                            \
    static_assert(offsetof(type, last) == offsetof(type, first) + (count - 1) * stretch_bytes(HIL_STRETCH_##kind));

/** How a type of the core lies in memory: `layout_omni_robot_t` and so on. */
#define LANES_LAYOUT(type)                                                                                                     \
    HIL_LAYOUT_##type(LANES_CHECK) const hil_stretch_t stretches_##type[] = {HIL_LAYOUT_##type(HIL_STRETCH)};                  \
    const hil_layout_t layout_##type = {hil_stretches_##type, stretches_##type,                                                \
                                        sizeof stretches_##type / sizeof(hil_stretch_t)};

LANES_LAYOUT(omni_robot_t)
LANES_LAYOUT(omni_robot_config_t)
LANES_LAYOUT(omni_inputs_t)
LANES_LAYOUT(omni_outputs_t)
LANES_LAYOUT(omni_reference_t)

/** `plan` points to eight plans (plans.h). */
void omni_trajectory_evaluate(const omni_trajectory_t *plan, uint64_t time_us, omni_reference_t *reference) {
    hil_lanes_plans_evaluate(reinterpret_cast<const hil_lanes_plans_t *>(plan), time_us, &layout_omni_reference_t, reference);
}

} // namespace core
} // namespace

#endif
