// SPDX-License-Identifier: MIT
#include "boards/teensy40/pins.h"

#include <Arduino.h>

#include "boards/teensy40/faults.h"
#include "boards/teensy40/motor_pins.h"
#include "omni/wiring_gen.h"

namespace omni {
namespace {

constexpr bool oe_wired = wiring::output_enable_pin >= 0;
constexpr uint8_t oe_pin = oe_wired ? static_cast<uint8_t>(wiring::output_enable_pin) : 0;
constexpr bool button_wired = wiring::stop_button_pin >= 0;
constexpr uint8_t button_pin = button_wired ? static_cast<uint8_t>(wiring::stop_button_pin) : 0;

void drive_outputs_off() {
    *portSetRegister(oe_pin) = digitalPinToBitMask(oe_pin); // before the pin becomes an output
    pinMode(oe_pin, OUTPUT);
}

} // namespace

void Teensy40OutputEnable::begin() {
    if (oe_wired) {
        drive_outputs_off();
        set_on_fault(portSetRegister(oe_pin), digitalPinToBitMask(oe_pin));
    }
}

bool Teensy40OutputEnable::wired() {
    return oe_wired;
}

void Teensy40OutputEnable::set(bool on) {
    if (!oe_wired) {
        return;
    }
    if (released_) {
        released_ = false;
        drive_outputs_off();
    }
    digitalWrite(oe_pin, on ? LOW : HIGH);
}

void Teensy40OutputEnable::release() {
    if (oe_wired) {
        released_ = true;
        pinMode(oe_pin, INPUT);
    }
}

bool Teensy40StopButton::wired() {
    return button_wired;
}

void Teensy40StopButton::begin() {
    if (button_wired) {
        pinMode(button_pin, INPUT_PULLUP);
    }
}

bool Teensy40StopButton::open() {
    return button_wired && digitalRead(button_pin) != LOW;
}

void Teensy40Light::begin() {
    pinMode(wiring::light_pin, OUTPUT);
}

void Teensy40Light::set(bool on) {
    digitalWrite(wiring::light_pin, on ? HIGH : LOW);
}

} // namespace omni

/// Called by Teensyduino's start-up some milliseconds after reset, before it waits 300 ms for USB.
extern "C" void startup_middle_hook() {
    if (omni::oe_wired) {
        omni::drive_outputs_off();
    }
    omni::Teensy40MotorPins::drive_low();
}
