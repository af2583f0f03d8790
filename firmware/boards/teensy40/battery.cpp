// SPDX-License-Identifier: MIT
#include "boards/teensy40/battery.h"

#include <Arduino.h>

// Of Teensyduino's analog.c, which declares it in no header: converter channel of a pin; bit 7: only on ADC2.
extern "C" const uint8_t pin_to_channel[];

namespace omni {
namespace {

constexpr uint8_t second_converter = 0x80;
constexpr int bits = 12;
constexpr float volts_per_step = 3.3f / 4095.0f;
constexpr float gain = 1.0f / 8.0f; ///< per tick of 1 ms

} // namespace

void Battery::begin() {
    analogReadResolution(bits);
    analogRead(pin_); // sets the pad up and waits for the calibration
    const uint8_t channel = pin_to_channel[pin_];
    const bool second = (channel & second_converter) != 0;
    control_ = second ? &ADC2_HC0 : &ADC1_HC0;
    status_ = second ? &ADC2_HS : &ADC1_HS;
    result_ = second ? &ADC2_R0 : &ADC1_R0;
    channel_ = channel & ~static_cast<uint32_t>(second_converter);
    *control_ = channel_;
}

void Battery::sample() {
    if (control_ == nullptr || (*status_ & ADC_HS_COCO0) == 0) {
        return;
    }
    const float volts = static_cast<float>(*result_) * volts_per_step * divider_;
    volts_ = begun_ ? volts_ + gain * (volts - volts_) : volts;
    begun_ = true;
    *control_ = channel_;
}

} // namespace omni
