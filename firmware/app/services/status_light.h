// SPDX-License-Identifier: MIT
/// @file status_light.h  What the lamp says: a pattern per state, the same on every board (docs/reference/safety.md).
#pragma once

#include <cstdint>

#include "app/base/core.h"

namespace omni {

/// Length of a pattern, and of each of its slots.
constexpr uint32_t light_slots = 20;
constexpr uint64_t light_slot_us = 100'000;

/// Bit i: the lamp is on in slot i. @param ground_station somebody's heartbeats arrive.
uint32_t light_pattern(omni_safety_state_t state, bool ground_station);

/// Is the lamp on now? Two seconds per cycle.
bool light_on(omni_safety_state_t state, bool ground_station, uint64_t now_us);

} // namespace omni
