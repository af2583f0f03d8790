// SPDX-License-Identifier: MIT
/// @file flight_mode.h  HEARTBEAT.custom_mode, and mode requests by DO_SET_MODE and SET_MODE.
///
/// Bits 0 to 15 of custom_mode are our OMNI_MODE. Bits 16 to 23 and 24 to 31 are a main mode and a sub mode with PX4's
/// numbers: MAVSDK decodes them for every autopilot except ArduPilot, and stops its offboard setpoints three seconds
/// after the mode has changed. HEARTBEAT.autopilot is GENERIC.
///
/// OMNI_MODE numbers are not accepted as requests: 3 is also PX4's main mode "position", which MAVSDK requests before
/// manual control. Trajectories are started by OMNI_TRAJECTORY_START.
#pragma once

#include <cstdint>

#include "app/link/mavlink_types.h"
#include "omni/robot.h"

namespace omni {

/// Source: px4_custom_mode.h of PX4.
enum Px4MainMode : uint32_t { px4_position = 3, px4_auto = 4, px4_offboard = 6 };
enum Px4SubMode : uint32_t { px4_loiter = 3, px4_mission = 4 };

/// @param setpoint_kind omni_setpoint_kind_t @return OMNI_MODE
inline uint8_t mode_of(uint8_t setpoint_kind) {
    switch (setpoint_kind) {
    case OMNI_SETPOINT_POSE:
        return OMNI_MODE_POSE;
    case OMNI_SETPOINT_VELOCITY_BODY:
    case OMNI_SETPOINT_VELOCITY_WORLD:
        return OMNI_MODE_VELOCITY;
    case OMNI_SETPOINT_TRAJECTORY:
        return OMNI_MODE_TRAJECTORY;
    case OMNI_SETPOINT_DUTY:
        return OMNI_MODE_DUTY;
    default:
        return OMNI_MODE_HOLD;
    }
}

/// @param mode OMNI_MODE @return HEARTBEAT.custom_mode
inline uint32_t custom_mode(uint32_t mode) {
    switch (mode) {
    case OMNI_MODE_HOLD:
        return mode | px4_auto << 16 | px4_loiter << 24;
    case OMNI_MODE_TRAJECTORY:
        return mode | px4_auto << 16 | px4_mission << 24;
    default:
        return mode | px4_offboard << 16;
    }
}

enum class ModeRequest : uint8_t {
    hold,             ///< hold the pose
    follow_setpoints, ///< follow the sender's setpoints; no motion by itself
    unknown,
};

/// Request by SET_MODE. @param custom_mode as in HEARTBEAT; 0 is hold, too.
inline ModeRequest requested_mode(uint32_t custom_mode) {
    const uint32_t main_mode = custom_mode >> 16 & 0xFF;
    const uint32_t sub_mode = custom_mode >> 24;
    if (custom_mode == 0 || (main_mode == px4_auto && sub_mode == px4_loiter)) {
        return ModeRequest::hold;
    }
    const bool follows = (main_mode == px4_offboard || main_mode == px4_position) && sub_mode == 0;
    return follows ? ModeRequest::follow_setpoints : ModeRequest::unknown;
}

/// Request by DO_SET_MODE: packed custom_mode in the first parameter, or main mode and sub mode.
inline ModeRequest requested_mode(float custom_mode, float sub_mode) {
    constexpr float packed = 65536.0f;
    constexpr float beyond = 4294967296.0f;
    if (custom_mode == 0.0f) {
        return ModeRequest::hold;
    }
    if (custom_mode >= packed && custom_mode < beyond) {
        return requested_mode(static_cast<uint32_t>(custom_mode));
    }
    const bool in_range = custom_mode >= 1.0f && custom_mode <= 255.0f && sub_mode >= 0.0f && sub_mode <= 255.0f;
    if (!in_range) {
        return ModeRequest::unknown;
    }
    const auto main_mode = static_cast<uint32_t>(custom_mode);
    const auto sub = static_cast<uint32_t>(sub_mode);
    const bool whole = static_cast<float>(main_mode) == custom_mode && static_cast<float>(sub) == sub_mode;
    return whole ? requested_mode(main_mode << 16 | sub << 24) : ModeRequest::unknown;
}

} // namespace omni
