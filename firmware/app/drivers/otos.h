// SPDX-License-Identifier: MIT
/// @file otos.h  SparkFun's Qwiic OTOS (a PAA5160E1 that sees the floor, and a 6-axis IMU), for register_flow.h.
///
/// Registers and scales: SparkFun's public driver, version 1.0 of the chip's firmware. It integrates a pose at 417 Hz
/// in 16 bits: 20 m, one turn. Its power-up calibration of the gyro is short; the driver requests 255 samples of 2.4
/// ms, during which (0.6 s) the robot must be at rest. A written pose takes effect in its next cycle, within 2.4 ms.
/// While tilted it ignores its accelerometer, which is no fault. The latency is not documented: FLOW_DELAY is an
/// assumption until measured.
#pragma once

#include "app/drivers/pose_counter.h"

namespace omni::otos {

constexpr uint8_t address = 0x17;
constexpr uint8_t reg_product_id = 0x00;
constexpr uint8_t reg_imu_calibration = 0x06;
constexpr uint8_t reg_reset = 0x07;
constexpr uint8_t reg_signal_process = 0x0E;
constexpr uint8_t reg_status = 0x1F; ///< the position follows: x, y, heading, two bytes each, the low one first
constexpr uint8_t reg_position = 0x20;

constexpr uint8_t product_id = 0x5F;
constexpr uint8_t samples = 255;
constexpr uint8_t reset_tracking = 0x01;
constexpr uint8_t all_processing = 0x0F; ///< look-up table, accelerometer, rotation, variances: as after reset
constexpr uint8_t warn_optical = 0x02;
constexpr uint8_t failed = 0xC0; ///< failure of the optical chip or the IMU

constexpr float m_per_step = 10.0f / 32768.0f;
constexpr float rad_per_step = 3.14159265f / 32768.0f;

inline constexpr uint8_t calibrate[] = {2, reg_imu_calibration, samples, 0};
inline constexpr uint8_t start[] = {2, reg_signal_process, all_processing, 2, reg_reset, reset_tracking, 0};
inline constexpr uint8_t zero[] = {7, reg_position, 0, 0, 0, 0, 0, 0, 0};

inline float signed_value(const uint8_t *bytes) {
    return static_cast<float>(static_cast<int16_t>(static_cast<uint16_t>(bytes[0] | bytes[1] << 8)));
}

inline CountedPose decode(const uint8_t *bytes) {
    CountedPose pose;
    pose.status = bytes[0];
    if ((pose.status & failed) != 0) {
        pose.cause = FlowCause::broken;
    } else if ((pose.status & warn_optical) != 0) {
        pose.cause = FlowCause::blind;
    }
    pose.x_m = signed_value(bytes + 1) * m_per_step;
    pose.y_m = signed_value(bytes + 3) * m_per_step;
    pose.heading_rad = signed_value(bytes + 5) * rad_per_step;
    return pose;
}

inline constexpr PoseCounter chip = {
    reg_product_id, {product_id, product_id}, calibrate, 650'000, start, 10'000, zero, 5'000, reg_status, 7, decode};

} // namespace omni::otos
