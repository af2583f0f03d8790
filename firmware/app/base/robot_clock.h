// SPDX-License-Identifier: MIT
/// @file robot_clock.h  The robot's time in this pass of the background: the board's, or the simulated one.
#pragma once

#include <cstdint>

namespace omni {

/// The application sets it once per pass, and with each tick of a host in the loop. All others read it.
struct RobotClock {
    uint64_t now_us = 0;

    uint32_t now_ms() const { return static_cast<uint32_t>(now_us / 1000); }
};

} // namespace omni
