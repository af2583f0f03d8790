// SPDX-License-Identifier: MIT
/// @file clock.h  Time from the processor's cycle counter, which goes on while interrupts are off.
#pragma once

#include <cstdint>

#include "app/base/board.h"

namespace omni {

/// Extends a 32-bit cycle counter, which wraps every 7.16 s at 600 MHz, to 64-bit time. It must be updated at
/// least once per wrap: the tick does so every millisecond.
class CycleTime {
public:
    /// @param cycles_per_us processor clock [MHz]. @param cycles the counter now: time starts at 0 here.
    CycleTime(uint32_t cycles_per_us, uint32_t cycles) : cycles_per_us_(cycles_per_us), last_(cycles) {}
    void advance(uint32_t cycles);
    uint64_t us() const { return us_; }
    uint64_t ns() const { return us_ * 1000 + rest_ * 1000 / cycles_per_us_; }

private:
    uint64_t us_ = 0;
    uint32_t cycles_per_us_;
    uint32_t last_;
    uint32_t rest_ = 0; ///< cycles beyond us_
};

class Teensy40Clock final : public Clock {
public:
    Teensy40Clock();
    uint64_t now_us() override;
    uint64_t stopwatch_ns() override;

private:
    CycleTime time_;
};

} // namespace omni
