// SPDX-License-Identifier: MIT
#include "boards/teensy40/motor_pins.h"

#include <Arduino.h>

#include "app/base/core.h"
#include "boards/teensy40/faults.h"
#include "boards/teensy40/motor_pins_wiring.h"

namespace omni {
namespace {

constexpr bool has_pins = wiring::motors_on_pins;
constexpr MotorPinsProblem problem =
    has_pins ? motor_pins_problem(wiring::motor_pins, wiring::encoder_pins, wiring::motor_pwm) : MotorPinsProblem::none;

static_assert(problem != MotorPinsProblem::no_pins,
              "robot file: give wiring.motor_pins, two Teensy pins for every wheel's motor");
static_assert(
    problem != MotorPinsProblem::no_pwm,
    "robot file: wiring.motor_pins needs pins with PWM: 2 to 15, 22, 23, 28, 29, 33; move the wire to one of them");
static_assert(
    problem != MotorPinsProblem::used_twice,
    "robot file: a pin of wiring.motor_pins is used twice, or by an encoder; move one of the two to a free pin");

constexpr unsigned resolution_bits = 12;
constexpr uint16_t full = 1u << resolution_bits;
constexpr uint32_t pad_gpio = 5 | 0x10; ///< ALT5 is GPIO on every pad; the input stays on, as pinMode() has it

uint8_t pin_of(size_t number) {
    return wiring::motor_pins[number / 2][number % 2];
}

} // namespace

bool Teensy40MotorPins::wired() {
    return has_pins;
}

void Teensy40MotorPins::drive_low() {
    for (size_t i = 0; has_pins && i < pins; ++i) {
        *portClearRegister(pin_of(i)) = digitalPinToBitMask(pin_of(i)); // before the pin becomes an output
        pinMode(pin_of(i), OUTPUT);
    }
}

void Teensy40MotorPins::begin() {
    drive_low();
    analogWriteResolution(resolution_bits);
    for (size_t i = 0; has_pins && i < pins; ++i) {
        pad_[i] = pad_gpio;
        on_fault(portClearRegister(pin_of(i)), digitalPinToBitMask(pin_of(i)));
        on_fault(portConfigRegister(pin_of(i)), pad_gpio);
        if (has_pwm(pin_of(i))) {
            analogWriteFrequency(pin_of(i), static_cast<float>(wiring::motor_pwm_Hz));
        }
    }
}

bool Teensy40MotorPins::serves_driver(uint8_t driver) {
    return has_pins && driver == wiring::motor_driver;
}

/// Low is set before the pad goes back to it, and a timer's duty before the pad goes to the timer.
void Teensy40MotorPins::connect(size_t number, uint16_t steps) {
    const uint8_t pin = pin_of(number);
    steps_[number] = steps;
    if (steps == 0 || steps >= full) {
        digitalWrite(pin, steps == 0 ? LOW : HIGH);
        *portConfigRegister(pin) = pad_gpio;
    } else {
        analogWrite(pin, steps);
    }
    pad_[number] = *portConfigRegister(pin);
}

bool Teensy40MotorPins::set_steps(const MotorPinSteps *steps, size_t wheels) {
    bool healthy = true;
    for (size_t i = 0; has_pins && i < pins && i < 2 * wheels; ++i) {
        const uint16_t wanted = i % 2 == 0 ? steps[i / 2].first : steps[i / 2].second;
        const bool kept = *portConfigRegister(pin_of(i)) == pad_[i];
        healthy = healthy && kept;
        if (!kept || wanted != steps_[i]) {
            connect(i, wanted);
        }
    }
    return healthy;
}

} // namespace omni
