// SPDX-License-Identifier: MIT
/// @file gyro_registers.h  Description of a gyro chip: registers and values, as data for register_gyro.h.
///
/// One header per chip defines it (icm42688.h, lsm6dso.h, bmi270.h).
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/gyro_chip.h"

namespace omni {

/// Writes of one batch: number of bytes, register, values, repeated. A number of 0 ends the list.
/// At most I2cTransaction::max_write bytes each, and GyroRegisters::max_writes of them.
using GyroWrites = const uint8_t *;

/// Step of the initialisation sequence.
struct GyroStep {
    enum class Kind : uint8_t {
        write,  ///< `writes`, then wait
        upload, ///< the configuration file, in pieces, then wait
        expect  ///< poll the register until (value & mask) matches; wait between attempts
    };
    Kind kind = Kind::write;
    GyroWrites writes = nullptr;
    uint32_t wait_us = 0;
    uint8_t reg = 0;
    uint8_t mask = 0xFF;
    uint8_t value = 0;
    uint8_t attempts = 1;
};

/// Registers that are read back periodically in place of a reading, with their expected values.
struct RegisterCheck {
    uint8_t reg = 0;
    uint8_t count = 0;
    const uint8_t *expected = nullptr;
    uint8_t mask = 0xFF; ///< compared bits of each byte
    GyroCause cause = GyroCause::lost;
};

struct GyroRegisters {
    static constexpr size_t max_writes = 8;
    uint8_t identity_reg = 0;
    uint8_t identity = 0;
    GyroWrites before_identity = nullptr; ///< writes before the identity check; nullptr: none
    const GyroStep *steps = nullptr;
    uint8_t step_count = 0;
    const RegisterCheck *checks = nullptr; ///< settings first
    uint8_t check_count = 0;
    uint8_t data_reg = 0; ///< x, y, z, two bytes each
    bool high_byte_first = false;
    /// Reading on all three axes that marks "no data" (gyro off or starting): triggers a read-back of the settings. For
    /// chips without such a code it is the value after reset; a coincidence costs one reading.
    int16_t no_reading = 0;
    float rad_s_per_step = 0.0f;
    int16_t end_of_range = INT16_MAX; ///< [steps] a reading of this or more is saturated
    uint8_t upload_reg = 0;           ///< data register of the configuration file; its address registers:
    uint8_t upload_place_reg = 0;     ///< bits 0 to 3 and 4 to 11 of the number of the 16-bit word
};

/// For a robot without a gyro.
inline constexpr GyroRegisters no_gyro;

} // namespace omni
