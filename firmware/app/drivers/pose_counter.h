// SPDX-License-Identifier: MIT
/// @file pose_counter.h  What a driver must know of a chip that counts its own pose: registers and their values, as
/// data.
///
/// One header per chip fills this in (otos.h, pinpoint.h). The driver itself is register_flow.h.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/flow_chip.h"
#include "app/drivers/i2c_writes.h"

namespace omni {

/// What a chip says in one reading.
struct CountedPose {
    float x_m = 0.0f;
    float y_m = 0.0f;
    float heading_rad = 0.0f; ///< counter-clockwise; may wrap at a half turn, or go on
    FlowCause cause = FlowCause::none;
    bool ready = true; ///< false: it is getting ready, and the pose means nothing
    uint8_t status = 0;
};

struct PoseCounter {
    static constexpr size_t max_identities = 2;
    uint8_t identity_reg = 0;
    uint8_t identities[max_identities] = {}; ///< what it may say; equal ones: only that
    I2cWrites calibrate = nullptr;           ///< once, while the robot stands; nullptr: nothing
    uint32_t calibrate_us = 0;               ///< how long that takes
    I2cWrites start = nullptr;               ///< settings, before each start
    uint32_t start_us = 0;
    I2cWrites zero = nullptr; ///< its pose becomes zero,
    uint32_t zero_us = 0;     ///< so much later
    uint8_t data_reg = 0;
    uint8_t data_count = 0;
    CountedPose (*decode)(const uint8_t *bytes) = nullptr;
};

/// Of a robot without one.
inline constexpr PoseCounter no_flow;

} // namespace omni
