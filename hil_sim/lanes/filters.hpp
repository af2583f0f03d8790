// SPDX-License-Identifier: MIT
/**
 * @file filters.hpp
 * Kinematics, filters and sliding mode controller of the control core for eight runs at once. They are the very sources
 * of shared/core, compiled with lanes for numbers, in namespace `core` of the including file, there to be inlined.
 */
#ifndef HIL_LANES_FILTERS_HPP
#define HIL_LANES_FILTERS_HPP

#include "core_types.hpp"

#define OMNI_INLINE LANES_INLINE
#define OMNI_KINEMATICS_INLINE LANES_INLINE
#define OMNI_PID_INLINE LANES_INLINE

namespace { // NOLINT(cert-dcl59-cpp): each file and CPU level has its own
namespace core {

#include "control/pid_inline.h"
#include "math/math_inline.h"
#include "model/kinematics_inline.h"

/* The sources ask for the callable forms of what is inline already. */
#undef OMNI_INLINE
#undef OMNI_KINEMATICS_INLINE
#undef OMNI_PID_INLINE

#include "control/ismc.c"
#include "estimate/motor_kf.c"
#include "estimate/pose_ekf.c"
#include "estimate/pose_ekf_correct.c"
#include "estimate/pose_ekf_flow.c"
#include "estimate/pose_ekf_gyro.c"
#include "estimate/pose_ekf_history.c"
#include "math/math.c"
#include "model/kinematics.c"

} // namespace core
} // namespace

#endif
