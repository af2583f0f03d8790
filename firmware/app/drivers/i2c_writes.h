// SPDX-License-Identifier: MIT
/// @file i2c_writes.h  Writes to a chip's registers, as data.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "app/base/board.h"

namespace omni {

/// Number of bytes, register, values, repeated. A number of 0 ends the list.
/// At most I2cTransaction::max_write bytes each.
using I2cWrites = const uint8_t *;

inline I2cTransaction i2c_write_of(uint8_t address, const uint8_t *bytes, size_t count) {
    I2cTransaction transaction;
    transaction.address = address;
    transaction.write_length = static_cast<uint8_t>(count);
    std::copy(bytes, bytes + count, transaction.write);
    return transaction;
}

} // namespace omni
