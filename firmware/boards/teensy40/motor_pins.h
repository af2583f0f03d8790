// SPDX-License-Identifier: MIT
/// @file motor_pins.h  PWM for the motors on pins of a Teensy 4.0: FlexPWM or a quad timer, whichever the pin has.
///
/// A pin that is low or high for the whole period is an ordinary output: no timer can then let a pulse through. In a
/// reset the pads become inputs that keep their last level weakly, so every wire needs a resistor to ground
/// (docs/guides/robot-file.md).
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"
#include "omni/wiring_gen.h"

namespace omni {

class Teensy40MotorPins final : public MotorPins {
public:
    /// The robot file has its motors on the processor's pins.
    static bool wired();
    /// Drive all pins low, at once. Of no effect on a robot that has none.
    static void drive_low();
    /// Low, with the timers set up, and low by any fault of the processor.
    void begin();
    bool serves_driver(uint8_t driver) override;
    /// False if a pad has lost its connection to what drives it. Cheap where nothing changes.
    bool set_steps(const MotorPinSteps *steps, size_t wheels) override;

private:
    static constexpr size_t pins = 2 * wiring::wheels;

    void connect(size_t number, uint16_t steps);

    uint16_t steps_[pins] = {};
    uint32_t pad_[pins] = {}; ///< what is written to each pad's SW_MUX_CTL register
};

} // namespace omni
