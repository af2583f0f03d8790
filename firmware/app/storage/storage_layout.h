// SPDX-License-Identifier: MIT
/// @file storage_layout.h  Layout of the non-volatile memory.
///
///     0                     parameters, slot 0    ┐ (size - tail) / 2 each, see param_store.h
///     (size - tail) / 2     parameters, slot 1    ┘
///     size - tail           signing key, slots 0 and 1
///     size - tail + 2 key   signing time, slots 0 and 1
///     size - 2 latch        emergency stop, slots 0 and 1
///
/// 2048 bytes are enough for all parameters. The smallest tested size is 1080 bytes (EEPROM emulation of the Teensy
/// core): 444 bytes per parameter slot, enough for 70 parameters that differ from the robot file's.
#pragma once

#include <cstddef>

namespace omni {

/// Bytes of one record slot around its content: magic, sequence, CRC-32.
constexpr size_t record_overhead = 12;
/// Signing key: 1 byte present, 3 spare, 32 key.
constexpr size_t key_content = 36;
/// Signing time: 8 bytes.
constexpr size_t signing_time_size = 8;
constexpr size_t key_slots = 2 * (record_overhead + key_content);
constexpr size_t time_slots = 2 * (record_overhead + signing_time_size);
/// Emergency stop: a word.
constexpr size_t latch_content = 4;
constexpr size_t latch_slots = 2 * (record_overhead + latch_content);
/// Bytes at the end of the memory that are not the parameters'; some of them are spare.
constexpr size_t storage_tail = 192;
static_assert(key_slots + time_slots + latch_slots <= storage_tail, "the records do not fit");

} // namespace omni
