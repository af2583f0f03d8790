// SPDX-License-Identifier: MIT
/// @file crc32.h  CRC-32 (IEEE 802.3, reflected) of stored data.
#pragma once

#include <cstddef>
#include <cstdint>

namespace omni {

/// @param before CRC of the preceding bytes; 0: none.
inline uint32_t crc32(const uint8_t *bytes, size_t length, uint32_t before = 0) {
    uint32_t crc = ~before;
    for (size_t i = 0; i < length; ++i) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; ++bit) {
            crc = (crc >> 1) ^ ((crc & 1) != 0 ? 0xEDB88320u : 0);
        }
    }
    return ~crc;
}

} // namespace omni
