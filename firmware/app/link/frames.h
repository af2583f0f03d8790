// SPDX-License-Identifier: MIT
/// @file frames.h  Conversion between our coordinate frames and MAVLink's; only here.
///
/// Our world: x, y on the floor, z up, theta counter-clockwise. As MAVLink's local NED: North = x, East = -y, Down =
/// -z, so x_ned = x, y_ned = -y, z_ned = 0, yaw_ned = -theta (clockwise). Our body: x forward, y
/// left; as MAVLink's FRD (forward, right, down): vx unchanged, vy and yaw rate negated. The map is its own inverse.
/// OMNI_* messages carry our frames unconverted.
#pragma once

#include "omni/types.h"

namespace omni {

/// World pose <-> NED pose (x, y, yaw).
inline omni_pose_t flip_frame(const omni_pose_t &pose) {
    return {pose.x, -pose.y, -pose.theta};
}

/// World twist <-> NED twist, body twist <-> FRD twist.
inline omni_twist_t flip_frame(const omni_twist_t &twist) {
    return {twist.vx, -twist.vy, -twist.wz};
}

} // namespace omni
