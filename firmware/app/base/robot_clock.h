// SPDX-License-Identifier: MIT
/// @file robot_clock.h  Robot time of the current background pass: board time, or simulated time in
/// hardware-in-the-loop.
#pragma once

#include <cstdint>

namespace omni {

/// Set by the application once per pass, and with each tick in hardware-in-the-loop.
struct RobotClock {
    uint64_t now_us = 0;

    uint32_t now_ms() const { return static_cast<uint32_t>(now_us / 1000); }
};

} // namespace omni
