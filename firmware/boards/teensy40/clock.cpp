// SPDX-License-Identifier: MIT
#include "boards/teensy40/clock.h"

#include <Arduino.h>

#include "boards/teensy40/processor.h"

namespace omni {

void CycleTime::advance(uint32_t cycles) {
    const uint32_t passed = cycles - last_;
    last_ = cycles;
    us_ += passed / cycles_per_us_;
    rest_ += passed % cycles_per_us_;
    if (rest_ >= cycles_per_us_) {
        rest_ -= cycles_per_us_;
        ++us_;
    }
}

Teensy40Clock::Teensy40Clock() : time_(F_CPU_ACTUAL / 1'000'000, ARM_DWT_CYCCNT) {}

uint64_t Teensy40Clock::now_us() {
    const InterruptLock lock; // the tick reads the time too
    time_.advance(ARM_DWT_CYCCNT);
    return time_.us();
}

uint64_t Teensy40Clock::stopwatch_ns() {
    const InterruptLock lock;
    time_.advance(ARM_DWT_CYCCNT);
    return time_.ns();
}

} // namespace omni
