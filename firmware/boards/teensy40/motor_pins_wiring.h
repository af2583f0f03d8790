// SPDX-License-Identifier: MIT
/// @file motor_pins_wiring.h  Checks of motors on the processor's own pins, at compile time.
///
/// The same rules in Python, for `omni robots check`: shared/generate/omni_schema/wiring.py.
#pragma once

#include <cstddef>
#include <cstdint>

namespace omni {

/// Error of a wiring.
enum class MotorPinsProblem : uint8_t {
    none,
    no_pins,    ///< the robot file gives no pins
    no_pwm,     ///< no timer reaches a pin that needs PWM
    used_twice, ///< by two motors, or by a motor and an encoder
};

constexpr uint8_t motor_no_pin = 0xFF;

/// FlexPWM's outputs A and B or a quad timer reach the pin. See the i.MX RT1060 reference manual, "External Signals and
/// Pin Multiplexing"; the table is in pwm.c of the Teensy core.
constexpr bool has_pwm(uint8_t pin) {
    constexpr uint8_t others[] = {22, 23, 28, 29, 33};
    bool found = pin >= 2 && pin <= 15;
    for (const uint8_t other : others) {
        found = found || pin == other;
    }
    return found;
}

/// @param pins two per wheel. @param pwm which of the two need PWM.
template <size_t wheels>
constexpr MotorPinsProblem motor_pins_problem(const uint8_t (&pins)[wheels][2], const uint8_t (&encoders)[wheels][2],
                                              const bool (&pwm)[2]) {
    for (size_t i = 0; i < 2 * wheels; ++i) {
        const uint8_t pin = pins[i / 2][i % 2];
        if (pin == motor_no_pin) {
            return MotorPinsProblem::no_pins;
        }
        if (pwm[i % 2] && !has_pwm(pin)) {
            return MotorPinsProblem::no_pwm;
        }
        for (size_t j = 0; j < 2 * wheels; ++j) {
            if ((j < i && pins[j / 2][j % 2] == pin) || encoders[j / 2][j % 2] == pin) {
                return MotorPinsProblem::used_twice;
            }
        }
    }
    return MotorPinsProblem::none;
}

} // namespace omni
