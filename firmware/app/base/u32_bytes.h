// SPDX-License-Identifier: MIT
/// @file u32_bytes.h  Unaligned access to 32-bit words in a byte buffer, in the processor's byte order.
#pragma once

#include <cstdint>
#include <cstring>

namespace omni {

inline void write_u32(uint8_t *at, uint32_t value) {
    std::memcpy(at, &value, sizeof value);
}

inline uint32_t read_u32(const uint8_t *at) {
    uint32_t value = 0;
    std::memcpy(&value, at, sizeof value);
    return value;
}

} // namespace omni
