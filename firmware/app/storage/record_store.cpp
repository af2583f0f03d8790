// SPDX-License-Identifier: MIT
#include "app/storage/record_store.h"

#include <algorithm>
#include <cstring>

#include "app/base/crc32.h"
#include "app/base/flash_code.h"
#include "app/base/u32_bytes.h"

namespace omni {
namespace {

constexpr uint32_t magic = 0x31524D4F; // "OMR1"
constexpr size_t at_sequence = 4;
constexpr size_t at_content = 8;

} // namespace

Slot RecordStore::judge() const {
    Slot slot;
    const size_t covered = at_content + content_;
    slot.erased = std::all_of(buffer_, buffer_ + slot_size(), [](uint8_t byte) { return byte == 0xFF; });
    slot.valid = read_u32(buffer_) == magic && read_u32(buffer_ + covered) == crc32(buffer_, covered);
    slot.sequence = read_u32(buffer_ + at_sequence);
    return slot;
}

RecordStore::Result RecordStore::load(uint8_t *data) {
    const bool damaged = is_damaged(inspect(0)) && is_damaged(inspect(1));
    if (!read_newest()) {
        return damaged ? Result::damaged : Result::empty;
    }
    std::memcpy(data, buffer_ + at_content, content_);
    return Result::ok;
}

OMNI_COLD bool RecordStore::save(const uint8_t *data) {
    return write_next([this, data](uint32_t sequence) {
        const size_t covered = at_content + content_;
        write_u32(buffer_, magic);
        write_u32(buffer_ + at_sequence, sequence);
        std::memcpy(buffer_ + at_content, data, content_);
        write_u32(buffer_ + covered, crc32(buffer_, covered));
        return slot_size();
    });
}

} // namespace omni
