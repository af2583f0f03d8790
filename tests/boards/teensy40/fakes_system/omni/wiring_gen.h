// SPDX-License-Identifier: MIT
// A robot with everything wired.
#pragma once

#include <cstddef>
#include <cstdint>

namespace omni::wiring {

constexpr int output_enable_pin = 9;
constexpr int stop_button_pin = 10;
constexpr int battery_pin = 14;
constexpr float battery_divider = 5.0f;
constexpr uint8_t light_pin = 13;

} // namespace omni::wiring
