// SPDX-License-Identifier: MIT
/// @file icm42688.h  The gyro in an ICM-42688-P (TDK data sheet DS-000347), for register_gyro.h.
///
/// Filters: anti-alias filter 488 Hz (DELT 11, DELTSQR 122, BITSHIFT 8). Then the UI filter, first order, bandwidth
/// half the data rate. Delays (calculated): sqrt(2) / (2 pi f) = 0.46 ms for the first, of second order, and 1 / (2 pi
/// f) = 0.32 ms for the other. A lower bandwidth would reduce noise but delay the heading in turns. Roller vibration is
/// at tens of hertz.
#pragma once

#include "app/drivers/gyro_registers.h"

namespace omni::icm42688 {

// User bank 0.
constexpr uint8_t reg_device_config = 0x11;
constexpr uint8_t reg_gyro_data = 0x25;
constexpr uint8_t reg_intf_config1 = 0x4D;
constexpr uint8_t reg_pwr_mgmt0 = 0x4E;
constexpr uint8_t reg_gyro_config0 = 0x4F;
constexpr uint8_t reg_gyro_config1 = 0x51; ///< GYRO_ACCEL_CONFIG0 follows
constexpr uint8_t reg_who_am_i = 0x75;
constexpr uint8_t reg_bank_select = 0x76; ///< in every bank
// User bank 1.
constexpr uint8_t reg_gyro_config_static3 = 0x0C; ///< anti-alias filter, to 0x0E

constexpr uint8_t soft_reset = 0x01;
/// Reset value 0x91, but with adaptive range (bits 7:6) off. The bits are undocumented. Public drivers
/// disable it, as readings freeze briefly while the chip changes its range.
constexpr uint8_t no_adaptive_range = 0x51;
constexpr uint8_t gyro_low_noise = 0x0C; ///< accelerometer off
constexpr uint8_t range_2000_dps_1_kHz = 0x06;
constexpr uint8_t accel_config0_reset = 0x06;
constexpr uint8_t aaf_delt = 11;
constexpr uint8_t aaf_delt_squared = 122;
constexpr uint8_t aaf_bitshift = 8u << 4;
constexpr uint8_t ui_first_order = 0x12;
constexpr uint8_t ui_half_rate = 0x10; ///< the accelerometer's as after reset

/// Select bank 0 first: an aborted start may have left another one.
inline constexpr uint8_t bank_0[] = {2, reg_bank_select, 0, 0};
inline constexpr uint8_t reset[] = {2, reg_device_config, soft_reset, 0};
/// The gyro is switched on last: no writes are allowed within 200 us after it.
inline constexpr uint8_t settings[] = {2,
                                       reg_bank_select,
                                       1, //
                                       4,
                                       reg_gyro_config_static3,
                                       aaf_delt,
                                       aaf_delt_squared,
                                       aaf_bitshift, //
                                       2,
                                       reg_bank_select,
                                       0, //
                                       2,
                                       reg_intf_config1,
                                       no_adaptive_range, //
                                       2,
                                       reg_gyro_config0,
                                       range_2000_dps_1_kHz, //
                                       3,
                                       reg_gyro_config1,
                                       ui_first_order,
                                       ui_half_rate, //
                                       2,
                                       reg_pwr_mgmt0,
                                       gyro_low_noise, //
                                       0};
/// Reset: the data sheet's 1 ms, and one more. Gyro start-up is 30 ms, and it must stay on for 45 ms at least.
inline constexpr GyroStep steps[] = {{GyroStep::Kind::write, reset, 2000}, {GyroStep::Kind::write, settings, 60'000}};
/// From reg_intf_config1 on.
inline constexpr uint8_t expected[] = {no_adaptive_range,   gyro_low_noise, range_2000_dps_1_kHz,
                                       accel_config0_reset, ui_first_order, ui_half_rate};
inline constexpr RegisterCheck checks[] = {{reg_intf_config1, sizeof expected, expected}};

inline constexpr GyroRegisters registers = {reg_who_am_i,
                                            0x47,
                                            bank_0,
                                            steps,
                                            sizeof steps / sizeof steps[0],
                                            checks,
                                            sizeof checks / sizeof checks[0],
                                            reg_gyro_data,
                                            true,
                                            INT16_MIN,
                                            2000.0f / 32768.0f * 0.017453293f};

} // namespace omni::icm42688
