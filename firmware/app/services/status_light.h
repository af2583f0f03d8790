// SPDX-License-Identifier: MIT
/// @file status_light.h  Status LED: blink pattern per state (docs/reference/safety.md).
#pragma once

#include <cstdint>

#include "app/base/core.h"

namespace omni {

/// Length of a pattern, and of each of its slots.
constexpr uint32_t light_slots = 20;
constexpr uint64_t light_slot_us = 100'000;

/// Blink pattern: bit i: on in slot i. @param ground_station heartbeats are being received.
uint32_t light_pattern(omni_safety_state_t state, bool ground_station);

/// Is the LED on now? The cycle is two seconds.
bool light_on(omni_safety_state_t state, bool ground_station, uint64_t now_us);

} // namespace omni
