// SPDX-License-Identifier: MIT
/// @file tick_jitter.h  How punctually ticks start: the spread of their distance to the grid of the tick period.
#pragma once

#include <cstdint>

#include "app/base/core.h"

namespace omni {

class TickJitter {
public:
    /// Forget everything, e.g. before another clock.
    void restart() { *this = TickJitter(); }
    /// A tick starts. @param now_ns free-running clock.
    void started(uint64_t now_ns);
    /// Latest minus earliest start, each relative to its place in the grid, in the last complete window of ticks [us].
    /// Missed ticks count as one that came as late as the first of them was due. 0 until a window is complete.
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
