// SPDX-License-Identifier: MIT
#include "app/storage/param_store.h"

#include <algorithm>
#include <cstring>

#include "app/base/crc32.h"
#include "app/base/flash_code.h"
#include "app/base/u32_bytes.h"
#include "app/storage/storage_layout.h"

namespace omni {
namespace {

constexpr uint32_t magic = 0x34504D4F; // "OMP4"
constexpr size_t at_schema = 4;
constexpr size_t at_count = 8;
constexpr size_t header_length = 12;
constexpr size_t entry_length = 6;
constexpr size_t crc_length = 4;

int32_t parameter_of_key(uint16_t key) {
    for (int32_t i = 0; i < OMNI_PARAM_COUNT; ++i) {
        if (omni_param_table[i].storage_key == key) {
            return i;
        }
    }
    return -1;
}

} // namespace

/// Bytes for the set, 0 if the memory is too small for one.
size_t ParamStore::room() const {
    const size_t size = storage_.size();
    const size_t room = size > storage_tail ? std::min(size - storage_tail, max_size) : 0;
    return room >= header_length + crc_length ? room : 0;
}

/// Read the set into the buffer and validate it.
OMNI_COLD StoreResult ParamStore::read() {
    const size_t size = room();
    if (size == 0) {
        return StoreResult::empty;
    }
    if (!storage_.read(0, buffer_, size)) {
        return StoreResult::damaged;
    }
    if (std::all_of(buffer_, buffer_ + header_length, [](uint8_t byte) { return byte == 0xFF; })) {
        return StoreResult::empty;
    }
    const size_t count = read_u32(buffer_ + at_count);
    if (read_u32(buffer_) != magic || count > (size - header_length - crc_length) / entry_length) {
        return StoreResult::damaged;
    }
    const size_t length = header_length + count * entry_length;
    return read_u32(buffer_ + length) == crc32(buffer_, length) ? StoreResult::ok : StoreResult::damaged;
}

OMNI_COLD StoreResult ParamStore::load(omni_real_t *values) {
    rejected_params_ = {};
    const StoreResult found = read();
    if (found != StoreResult::ok) {
        return found;
    }
    const size_t count = read_u32(buffer_ + at_count);
    for (size_t i = 0; i < count; ++i) {
        const uint8_t *entry = buffer_ + header_length + i * entry_length;
        const auto key = static_cast<uint16_t>(entry[0] | entry[1] << 8);
        const int32_t index = parameter_of_key(key);
        omni_real_t value = 0.0f;
        std::memcpy(&value, entry + 2, sizeof value);
        if (omni_param_check(index, value, false) == OMNI_OK) {
            values[index] = value;
        } else {
            rejected_params_.add(index, value);
        }
    }
    return StoreResult::ok;
}

/// @return length of the set in buffer_, 0 if it does not fit.
size_t ParamStore::compose(const omni_real_t *values, const omni_real_t *robot_values) {
    const size_t entries_end = room() - crc_length;
    size_t length = header_length;
    uint32_t count = 0;
    for (size_t i = 0; i < OMNI_PARAM_COUNT; ++i) {
        if (values[i] == robot_values[i]) {
            continue;
        }
        if (length + entry_length > entries_end) {
            return 0;
        }
        const uint16_t key = omni_param_table[i].storage_key;
        buffer_[length] = static_cast<uint8_t>(key);
        buffer_[length + 1] = static_cast<uint8_t>(key >> 8);
        std::memcpy(buffer_ + length + 2, &values[i], sizeof values[i]);
        length += entry_length;
        ++count;
    }
    write_u32(buffer_, magic);
    write_u32(buffer_ + at_schema, omni_param_schema_crc);
    write_u32(buffer_ + at_count, count);
    write_u32(buffer_ + length, crc32(buffer_, length));
    return length + crc_length;
}

OMNI_COLD StoreResult ParamStore::save(const omni_real_t *values, const omni_real_t *robot_values) {
    if (room() == 0) {
        return StoreResult::failed;
    }
    const size_t length = compose(values, robot_values);
    if (length == 0) {
        return StoreResult::full;
    }
    const uint32_t crc = read_u32(buffer_ + length - crc_length);
    const bool written = storage_.write(0, buffer_, length) && read() == StoreResult::ok &&
                         read_u32(buffer_ + length - crc_length) == crc;
    return written ? StoreResult::ok : StoreResult::failed;
}

} // namespace omni
