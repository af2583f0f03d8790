// SPDX-License-Identifier: MIT
/// @file lsm6dso.h  The gyro in an LSM6DSO (ST data sheet DS12140) and in the ISM330DHCX (DS13012), for
/// register_gyro.h. The registers used are identical except for the identity.
///
/// Filters at 1.66 kHz: 453 Hz in all, with FTYPE 3 of the first low-pass filter. Delay
/// sqrt(2) / (2 pi f) = 0.50 ms, calculated for second order (the data sheet does not give the order).
#pragma once

#include "app/drivers/gyro_registers.h"

namespace omni::lsm6dso {

constexpr uint8_t reg_who_am_i = 0x0F;
constexpr uint8_t reg_ctrl1_xl = 0x10; ///< CTRL2_G to CTRL7_G follow
constexpr uint8_t reg_ctrl3_c = 0x12;
constexpr uint8_t reg_ctrl9_xl = 0x18;
constexpr uint8_t reg_status = 0x1E;
constexpr uint8_t reg_outx_l_g = 0x22;

constexpr uint8_t sw_reset = 0x05;              ///< and IF_INC, as after reset
constexpr uint8_t accelerometer_off = 0x00;     ///< CTRL1_XL
constexpr uint8_t rate_1660_Hz_2000_dps = 0x8C; ///< CTRL2_G
constexpr uint8_t block_update = 0x44;          ///< CTRL3_C: BDU, IF_INC
constexpr uint8_t filter_on = 0x0A;             ///< CTRL4_C: LPF1_SEL_G; DRDY_MASK: no data ready until filters settle
constexpr uint8_t no_self_test = 0x00;          ///< CTRL5_C
constexpr uint8_t filter_453_Hz = 0x03;         ///< CTRL6_C: FTYPE 3
constexpr uint8_t high_performance = 0x00;      ///< CTRL7_G
/// CTRL9_XL: bit 1 is I3C_disable in one chip, DEVICE_CONF in the other. ST wants it set in both.
constexpr uint8_t no_i3c = 0xE2;
constexpr uint8_t gyro_data_ready = 0x02;

inline constexpr uint8_t reset[] = {2, reg_ctrl3_c, sw_reset, 0};
/// Block data update first, to avoid torn readings.
inline constexpr uint8_t settings[] = {2,
                                       reg_ctrl3_c,
                                       block_update, //
                                       2,
                                       reg_ctrl9_xl,
                                       no_i3c, //
                                       8,
                                       reg_ctrl1_xl,
                                       accelerometer_off,
                                       rate_1660_Hz_2000_dps,
                                       block_update,
                                       filter_on,
                                       no_self_test,
                                       filter_453_Hz,
                                       high_performance,
                                       0};
/// The reset takes 50 us; power-up takes 10 ms. The gyro is on after 70 ms.
inline constexpr GyroStep steps[] = {{GyroStep::Kind::write, reset, 15'000}, {GyroStep::Kind::write, settings, 80'000}};
/// From reg_ctrl1_xl on.
inline constexpr uint8_t expected[] = {accelerometer_off, rate_1660_Hz_2000_dps, block_update,    filter_on,
                                       no_self_test,      filter_453_Hz,         high_performance};
inline constexpr uint8_t measures[] = {gyro_data_ready};
inline constexpr RegisterCheck checks[] = {{reg_ctrl1_xl, sizeof expected, expected},
                                           {reg_status, 1, measures, gyro_data_ready, GyroCause::silent}};

/// 70 mdps a step: ST's figure, which is not its range over 2^15.
constexpr float rad_s_per_step = 0.07f * 0.017453293f;
constexpr int16_t range_steps = 28571; ///< 2000 dps

constexpr GyroRegisters with_identity(uint8_t identity) {
    return {reg_who_am_i,
            identity,
            nullptr,
            steps,
            sizeof steps / sizeof steps[0],
            checks,
            sizeof checks / sizeof checks[0],
            reg_outx_l_g,
            false,
            0,
            rad_s_per_step,
            range_steps};
}
inline constexpr GyroRegisters registers = with_identity(0x6C);

} // namespace omni::lsm6dso
