// SPDX-License-Identifier: MIT
/// @file IntervalTimer.h  Stands in for Teensyduino's: one timer, driven by the fake chip's time.
#pragma once

#include <cstdint>

class IntervalTimer {
public:
    bool begin(void (*function)(), uint32_t period_us);
    void end();
    void priority(uint8_t) {}
};
