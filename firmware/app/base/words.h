// SPDX-License-Identifier: MIT
/// @file words.h  32-bit words in stored bytes, in the processor's order; no alignment needed.
#pragma once

#include <cstdint>
#include <cstring>

namespace omni {

inline void put_word(uint8_t *at, uint32_t value) {
    std::memcpy(at, &value, sizeof value);
}

inline uint32_t get_word(const uint8_t *at) {
    uint32_t value = 0;
    std::memcpy(&value, at, sizeof value);
    return value;
}

} // namespace omni
