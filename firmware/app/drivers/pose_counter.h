// SPDX-License-Identifier: MIT
/// @file pose_counter.h  Description of a chip that integrates its own pose: registers and values, as data for
/// register_flow.h. One header per chip defines it (otos.h, pinpoint.h).
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/flow_chip.h"
#include "app/drivers/i2c_writes.h"

namespace omni {

/// Decoded reading of the chip: pose and status.
struct CountedPose {
    float x_m = 0.0f;
    float y_m = 0.0f;
    float heading_rad = 0.0f; ///< counter-clockwise; wrapped or continuous
    FlowCause cause = FlowCause::none;
    bool ready = true; ///< false: the chip is initialising, the pose is invalid
    uint8_t status = 0;
};

struct PoseCounter {
    static constexpr size_t max_identities = 2;
    uint8_t identity_reg = 0;
    uint8_t identities[max_identities] = {}; ///< accepted values; equal: only one
    I2cWrites calibrate = nullptr;           ///< writes that start the gyro calibration, at rest; nullptr: none
    uint32_t calibrate_us = 0;               ///< duration of the calibration
    I2cWrites start = nullptr;               ///< writes of the settings, at each start
    uint32_t start_us = 0;
    I2cWrites zero = nullptr; ///< writes that reset the pose to zero, effective
    uint32_t zero_us = 0;     ///< after this time
    uint8_t data_reg = 0;
    uint8_t data_count = 0;
    CountedPose (*decode)(const uint8_t *bytes) = nullptr;
};

/// For a robot without one.
inline constexpr PoseCounter no_flow;

} // namespace omni
