// SPDX-License-Identifier: MIT
/// @file storage_layout.h  Layout of the non-volatile memory.
///
///     0                 parameters, see param_store.h
///     size - tail       signing key
///     size - tail + key signing time
///     size - latch      emergency stop
///
/// 2048 bytes are enough for all parameters. The smallest tested size is 1080 bytes (EEPROM emulation of the Teensy
/// core): 888 bytes for parameters, enough for 145 that differ from the robot file's.
#pragma once

#include <cstddef>

namespace omni {

/// Bytes of a record around its content: magic, CRC-32.
constexpr size_t record_overhead = 8;
/// Signing key: 1 byte present, 3 spare, 32 key.
constexpr size_t key_content = 36;
/// Signing time: 8 bytes.
constexpr size_t signing_time_size = 8;
constexpr size_t key_record = record_overhead + key_content;
constexpr size_t time_record = record_overhead + signing_time_size;
/// Emergency stop: a word.
constexpr size_t latch_content = 4;
constexpr size_t latch_record = record_overhead + latch_content;
/// Bytes at the end of the memory that are not the parameters'; some of them are spare.
constexpr size_t storage_tail = 192;
static_assert(key_record + time_record + latch_record <= storage_tail, "the records do not fit");

} // namespace omni
