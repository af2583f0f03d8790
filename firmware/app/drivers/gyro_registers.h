// SPDX-License-Identifier: MIT
/// @file gyro_registers.h  What a gyro's driver must know of its chip: registers and their values, as data.
///
/// One header per chip fills this in (icm42688.h, lsm6dso.h, bmi270.h). The driver itself is register_gyro.h.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/gyro_chip.h"

namespace omni {

/// Writes of one batch, one after the other: number of bytes, register, values. A number of 0 ends the list.
/// At most I2cTransaction::max_write bytes each, and GyroRegisters::max_writes of them.
using GyroWrites = const uint8_t *;

/// A step of the start.
struct GyroStep {
    enum class Kind : uint8_t {
        write,  ///< `writes`, then wait
        upload, ///< the configuration file, in pieces, then wait
        expect  ///< read the register until it says `value` under `mask`; wait between two attempts
    };
    Kind kind = Kind::write;
    GyroWrites writes = nullptr;
    uint32_t wait_us = 0;
    uint8_t reg = 0;
    uint8_t mask = 0xFF;
    uint8_t value = 0;
    uint8_t attempts = 1;
};

/// Registers that are read back now and then in place of a reading, and what they say while all is well.
struct GyroLook {
    uint8_t reg = 0;
    uint8_t count = 0;
    const uint8_t *expected = nullptr;
    uint8_t mask = 0xFF; ///< of each byte: what counts
    GyroCause cause = GyroCause::lost;
};

struct GyroRegisters {
    static constexpr size_t max_writes = 8;
    uint8_t identity_reg = 0;
    uint8_t identity = 0;
    GyroWrites before_identity = nullptr; ///< nullptr: nothing
    const GyroStep *steps = nullptr;
    uint8_t step_count = 0;
    const GyroLook *looks = nullptr; ///< settings first
    uint8_t look_count = 0;
    uint8_t data_reg = 0; ///< x, y, z, two bytes each
    bool high_byte_first = false;
    /// What all three axes say of a gyro that is off or still starting. The settings are then read back. Of a chip that
    /// does not say so it is the value after a reset: one lost reading if it comes by chance.
    int16_t no_reading = 0;
    float rad_s_per_step = 0.0f;
    int16_t end_of_range = INT16_MAX; ///< [steps] a reading of this or more is saturated
    uint8_t upload_reg = 0;           ///< of the data of a configuration file; the two registers of its place:
    uint8_t upload_place_reg = 0;     ///< bits 0 to 3 and 4 to 11 of the number of the 16-bit word
};

/// Of a robot without one.
inline constexpr GyroRegisters no_gyro;

} // namespace omni
