// SPDX-License-Identifier: MIT
/// @file tick_jitter.h  Tick jitter: peak-to-peak deviation of tick starts from the nominal grid.
#pragma once

#include <cstdint>

#include "app/base/core.h"

namespace omni {

class TickJitter {
public:
    /// Reset, for example after a change of the clock.
    void restart() { *this = TickJitter(); }
    /// Record the start of a tick. @param now_ns free-running clock.
    void record_start(uint64_t now_ns);
    /// Latest minus earliest start relative to the grid, in the last complete window of ticks [us]. Missed ticks count
    /// as one that is late since the first of them was due. 0 until a window is complete.
    float max_us() const { return max_us_; }

    static constexpr uint32_t window_ticks = 1000;

private:
    static constexpr int64_t period_ns = static_cast<int64_t>(OMNI_TICK_US) * 1000;

    uint64_t due_ns_ = 0;
    int64_t earliest_ns_ = 0; ///< relative to due_ns_ of the tick
    int64_t latest_ns_ = 0;
    uint32_t count_ = 0;
    bool begun_ = false;
    float max_us_ = 0.0f;
};

} // namespace omni
