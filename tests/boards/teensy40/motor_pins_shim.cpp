// SPDX-License-Identifier: MIT
// extern "C" access to the motors' pins, and the pins behind fakes_motor_pins/Arduino.h.
#include "boards/teensy40/motor_pins.h"

#include <Arduino.h>

#include <algorithm>

#include "boards/teensy40/faults.h"

namespace {

constexpr size_t pin_count = 40, fault_writes = OMNI_FAULT_WRITES;
constexpr uint32_t gpio = 0x15, timer = 0x100;

/// A clear register holds what was written last; settle() then lets it act, as the hardware does at once.
struct Pin {
    volatile uint32_t clear = 0;
    volatile uint32_t pad = 0;
    bool output = false;
    bool high = true; // a pad that keeps what it had: the worst
    int steps = 0;
    float frequency_Hz = 0.0f;
};

Pin pins[pin_count];
unsigned writes_;
int glitches_;
omni_fault_write_t on_fault_[fault_writes];
size_t on_fault_count;
omni::Teensy40MotorPins motor_pins;

void settle() {
    for (Pin &pin : pins) {
        pin.high = pin.high && pin.clear == 0;
        pin.clear = 0;
    }
}

} // namespace

void pinMode(uint8_t pin, uint8_t mode) {
    settle();
    pins[pin].output = mode == OUTPUT;
    pins[pin].pad = gpio;
    glitches_ += pins[pin].high ? 1 : 0;
}
void digitalWrite(uint8_t pin, uint8_t level) {
    settle();
    pins[pin].high = level != LOW;
    ++writes_;
}
volatile uint32_t *portClearRegister(uint8_t pin) {
    return &pins[pin].clear;
}
volatile uint32_t *portConfigRegister(uint8_t pin) {
    return &pins[pin].pad;
}
void analogWriteResolution(unsigned) {}
void analogWriteFrequency(uint8_t pin, float frequency_Hz) {
    pins[pin].frequency_Hz = frequency_Hz;
}
void analogWrite(uint8_t pin, int value) {
    pins[pin].steps = value;
    pins[pin].pad = timer + pin;
    ++writes_;
}

namespace omni {

void on_fault(volatile uint32_t *address, uint32_t value) {
    on_fault_[on_fault_count++] = {address, value};
}

} // namespace omni

extern "C" {

void pins_drive_low() {
    omni::Teensy40MotorPins::drive_low();
}
void pins_begin() {
    motor_pins.begin();
}
bool pins_write(const uint16_t *steps) {
    omni::MotorPinSteps wheels[omni::wiring::wheels];
    for (size_t i = 0; i < omni::wiring::wheels; ++i) {
        wheels[i] = {steps[2 * i], steps[2 * i + 1]};
    }
    return motor_pins.set_steps(wheels, omni::wiring::wheels);
}
int pin_value(int pin) {
    settle();
    return pins[pin].pad == gpio ? pins[pin].high : pins[pin].steps;
}
unsigned pin_pad(int pin) {
    return pins[pin].pad;
}
int pin_frequency(int pin) {
    return static_cast<int>(pins[pin].frequency_Hz);
}
unsigned writes() {
    return writes_;
}
int glitches() {
    return glitches_;
}
void lose_pad(int pin) {
    pins[pin].pad = gpio;
}
void fault() {
    for (size_t i = 0; i < on_fault_count; ++i) {
        *on_fault_[i].address = on_fault_[i].value;
    }
}
}
