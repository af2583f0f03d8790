// SPDX-License-Identifier: MIT
/// @file pinpoint.h  goBILDA's Pinpoint (two dead wheels and a gyro), for register_flow.h.
///
/// Registers: goBILDA's public driver. Each has 32 bits, little-endian: integers and floats. BULK_READ
/// gives status, loop time, two encoders, x [mm], y [mm], heading [rad], three speeds. The driver reads the first seven
/// of these. Steps per millimetre, positions and directions of the wheels come from the robot
/// file (omni/flow_gen.h). Its gyro calibration on request takes 0.25 s; the robot must be at rest.
#pragma once

#include <cstring>

#include "app/drivers/pose_counter.h"

namespace omni::pinpoint {

constexpr uint8_t address = 0x31;
constexpr uint8_t reg_device_id = 1;
constexpr uint8_t reg_control = 4;
constexpr uint8_t reg_x = 8;
constexpr uint8_t reg_y = 9;
constexpr uint8_t reg_heading = 10;
constexpr uint8_t reg_bulk_read = 18;

constexpr uint8_t device_id = 1;
constexpr uint8_t device_id_v2 = 2;
constexpr uint8_t recalibrate = 0x01; ///< to reg_control
constexpr uint8_t ready = 0x01;       ///< of the status
constexpr uint8_t calibrating = 0x02;
constexpr uint8_t wheel_missing = 0x0C; ///< x, y
constexpr uint8_t imu_runaway = 0x10;

constexpr size_t at_x = 16;
constexpr size_t at_y = 20;
constexpr size_t at_heading = 24;

inline float float_value(const uint8_t *bytes) {
    const uint32_t bits = static_cast<uint32_t>(bytes[0]) | static_cast<uint32_t>(bytes[1]) << 8 |
                          static_cast<uint32_t>(bytes[2]) << 16 | static_cast<uint32_t>(bytes[3]) << 24;
    float value = 0.0f;
    std::memcpy(&value, &bits, sizeof value);
    return value;
}

inline CountedPose decode(const uint8_t *bytes) {
    CountedPose pose;
    pose.status = bytes[0];
    const bool failed = (pose.status & (wheel_missing | imu_runaway)) != 0; // then `ready` may be missing
    pose.ready = (pose.status & calibrating) == 0 && ((pose.status & ready) != 0 || failed);
    if ((pose.status & imu_runaway) != 0) {
        pose.cause = FlowCause::broken;
    } else if ((pose.status & wheel_missing) != 0) {
        pose.cause = FlowCause::unplugged;
    }
    pose.x_m = float_value(bytes + at_x) * 0.001f;
    pose.y_m = float_value(bytes + at_y) * 0.001f;
    pose.heading_rad = float_value(bytes + at_heading);
    return pose;
}

inline constexpr uint8_t calibrate[] = {5, reg_control, recalibrate, 0, 0, 0, 0};
/// A float of zero is four bytes of zero.
inline constexpr uint8_t zero[] = {5, reg_heading, 0, 0, 0, 0, 5, reg_x, 0, 0, 0, 0, 5, reg_y, 0, 0, 0, 0, 0};

/// Pinpoint with the robot file's settings.
constexpr PoseCounter with(I2cWrites settings) {
    return {
        reg_device_id, {device_id, device_id_v2}, calibrate, 300'000, settings, 10'000, zero, 5'000, reg_bulk_read, 28,
        decode};
}

} // namespace omni::pinpoint
