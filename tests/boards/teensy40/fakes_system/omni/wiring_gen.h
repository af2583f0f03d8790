// SPDX-License-Identifier: MIT
// A robot with everything wired.
#pragma once

#include <cstddef>
#include <cstdint>

namespace omni::wiring {

constexpr size_t wheels = 3;
constexpr uint32_t id = 0x12345678;
constexpr uint8_t encoder_pins[wheels][2] = {{255, 255}, {255, 255}, {255, 255}};
constexpr uint8_t motor_driver = 0;
constexpr bool motors_on_pins = false;
constexpr bool motor_pwm[2] = {false, false};
constexpr uint8_t motor_pins[wheels][2] = {{255, 255}, {255, 255}, {255, 255}};
constexpr uint32_t motor_pwm_Hz = 20000;
constexpr int output_enable_pin = 9;
constexpr int stop_button_pin = 10;
constexpr int battery_pin = 14;
constexpr float battery_divider = 5.0f;
constexpr uint8_t light_pin = 13;
constexpr uint8_t gyro_address = 0;
constexpr uint8_t flow_address = 0;

} // namespace omni::wiring
