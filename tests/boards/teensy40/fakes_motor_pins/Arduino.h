// SPDX-License-Identifier: MIT
// Pins of a Teensy whose motors hang on them, for the tests: levels, directions, pads and timers.
#pragma once

#include <cstdint>

constexpr uint8_t LOW = 0, HIGH = 1, OUTPUT = 1;
void pinMode(uint8_t pin, uint8_t mode);
void digitalWrite(uint8_t pin, uint8_t level);
volatile uint32_t *portClearRegister(uint8_t pin);
volatile uint32_t *portConfigRegister(uint8_t pin);
constexpr uint32_t digitalPinToBitMask(uint8_t pin) {
    return 1u << (pin % 32);
}
void analogWriteResolution(unsigned bits);
void analogWriteFrequency(uint8_t pin, float frequency_Hz);
void analogWrite(uint8_t pin, int value);
