// SPDX-License-Identifier: MIT
/// @file battery.h  Supply voltage by the analog-digital converter behind a divider. Never waits for a conversion.
#pragma once

#include <cstdint>

namespace omni {

class Battery {
public:
    /// @param divider V of the battery per V at the pin.
    Battery(uint8_t pin, float divider) : pin_(pin), divider_(divider) {}
    /// Set the converter up. Waits for its calibration.
    void begin();
    /// In every tick: take the last conversion, if it is done, and start the next one.
    void sample();
    /// Filtered with a time constant of 8 ms; 0 before the first conversion.
    float volts() const { return volts_; }

private:
    uint8_t pin_;
    float divider_;
    volatile uint32_t *control_ = nullptr;
    volatile uint32_t *status_ = nullptr;
    volatile uint32_t *result_ = nullptr;
    uint32_t channel_ = 0;
    bool begun_ = false;
    float volts_ = 0.0f;
};

} // namespace omni
