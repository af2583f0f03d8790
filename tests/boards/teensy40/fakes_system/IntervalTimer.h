// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>

class IntervalTimer {
public:
    void priority(uint8_t number);
    bool begin(void (*callback)(), uint32_t period_us);
    void end();
};
