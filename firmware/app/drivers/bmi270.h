// SPDX-License-Identifier: MIT
/// @file bmi270.h  The gyro in a BMI270 (Bosch data sheet BST-BMI270-DS000), for register_gyro.h.
///
/// The chip requires an upload of Bosch's configuration file of 8192 bytes (config_file in the robot file): 256 ticks.
///
/// Filter: the data sheet's 751 Hz at 3.2 kHz, halved by OSR2 to 376 Hz. Delay sqrt(2) / (2 pi f) = 0.60 ms, calculated
/// for a filter of second order (the data sheet does not give the order). OSR2 prevents aliasing of noise above 500 Hz
/// at the read rate of 1 kHz.
///
/// Not applied: Bosch's cross-axis correction of x by z (GYR_CAS), below 13 % of the rate about z, which is 0 if the x
/// axis points up.
#pragma once

#include "app/drivers/gyro_registers.h"

namespace omni::bmi270 {

constexpr uint8_t reg_chip_id = 0x00;
constexpr uint8_t reg_status = 0x03;
constexpr uint8_t reg_gyr_x_lsb = 0x12;
constexpr uint8_t reg_internal_status = 0x21;
constexpr uint8_t reg_gyr_conf = 0x42; ///< GYR_RANGE follows
constexpr uint8_t reg_init_ctrl = 0x59;
constexpr uint8_t reg_init_addr_0 = 0x5B; ///< INIT_ADDR_1 follows
constexpr uint8_t reg_init_data = 0x5E;
constexpr uint8_t reg_pwr_conf = 0x7C; ///< PWR_CTRL follows
constexpr uint8_t reg_cmd = 0x7E;

constexpr uint8_t soft_reset = 0xB6;
constexpr uint8_t no_power_save = 0x00;
constexpr uint8_t gyro_on = 0x02; ///< accelerometer off
/// Performance of filter (bit 7) and noise (bit 6), OSR2 (0x10), 3.2 kHz (0x0D).
constexpr uint8_t quiet_3200_Hz_osr2 = 0xDD;
constexpr uint8_t range_2000_dps = 0x00;
constexpr uint8_t initialised = 0x01;
constexpr uint8_t initialised_mask = 0x0F;
constexpr uint8_t gyro_data_ready = 0x40;

inline constexpr uint8_t reset[] = {2, reg_cmd, soft_reset, 0};
inline constexpr uint8_t awake[] = {2, reg_pwr_conf, no_power_save, 0};
inline constexpr uint8_t load_begin[] = {2, reg_init_ctrl, 0, 0};
inline constexpr uint8_t load_end[] = {2, reg_init_ctrl, 1, 0};
inline constexpr uint8_t settings[] = {3, reg_gyr_conf, quiet_3200_Hz_osr2, range_2000_dps, //
                                       3, reg_pwr_conf, no_power_save,      gyro_on,        0};
/// The reset takes 2 ms. From power save to the next write it is 450 us, rounded up to ticks. The file is processed
/// within 20 ms (timeout 150 ms). The gyro is on after 45 ms.
inline constexpr GyroStep steps[] = {
    {GyroStep::Kind::write, reset, 3000},
    {GyroStep::Kind::write, awake, 2000},
    {GyroStep::Kind::write, load_begin, 0},
    {GyroStep::Kind::upload, nullptr, 0},
    {GyroStep::Kind::write, load_end, 20'000},
    {GyroStep::Kind::expect, nullptr, 10'000, reg_internal_status, initialised_mask, initialised, 14},
    {GyroStep::Kind::write, settings, 60'000},
};
inline constexpr uint8_t expected_gyro[] = {quiet_3200_Hz_osr2, range_2000_dps};
inline constexpr uint8_t expected_power[] = {no_power_save, gyro_on};
inline constexpr uint8_t expected_status[] = {initialised};
inline constexpr uint8_t measures[] = {gyro_data_ready};
inline constexpr RegisterCheck checks[] = {{reg_gyr_conf, sizeof expected_gyro, expected_gyro},
                                           {reg_pwr_conf, sizeof expected_power, expected_power},
                                           {reg_internal_status, 1, expected_status, initialised_mask},
                                           {reg_status, 1, measures, gyro_data_ready, GyroCause::silent}};

inline constexpr GyroRegisters registers = {reg_chip_id,
                                            0x24,
                                            nullptr,
                                            steps,
                                            sizeof steps / sizeof steps[0],
                                            checks,
                                            sizeof checks / sizeof checks[0],
                                            reg_gyr_x_lsb,
                                            false,
                                            0,
                                            2000.0f / 32768.0f * 0.017453293f,
                                            INT16_MAX,
                                            reg_init_data,
                                            reg_init_addr_0};

} // namespace omni::bmi270
