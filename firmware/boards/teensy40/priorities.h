// SPDX-License-Identifier: MIT
/// @file priorities.h  Interrupt priorities. A smaller number interrupts a larger one; the NVIC keeps the upper four
/// bits.
///
/// Encoder edges come first: a missed one is lost, and each takes well under a microsecond. The tick and
/// the I2C master have the same priority, so neither ever sees the other half-way. Teensyduino's own: SysTick 32,
/// Serial1 64, USB and all others 128.
#pragma once

#include <cstdint>

namespace omni {

constexpr uint8_t priority_encoder_edges = 16;
constexpr uint8_t priority_tick = 48;
constexpr uint8_t priority_i2c = priority_tick;

} // namespace omni
