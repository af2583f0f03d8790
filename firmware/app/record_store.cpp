// SPDX-License-Identifier: MIT
#include "app/record_store.h"

#include <algorithm>
#include <cstring>

#include "app/crc32.h"
#include "app/words.h"

namespace omni {
namespace {

constexpr uint32_t magic = 0x31524D4F; // "OMR1"
constexpr size_t at_sequence = 4;
constexpr size_t at_content = 8;

} // namespace

/// Reads the slot into buffer_ and checks it.
RecordStore::Slot RecordStore::inspect(size_t number) {
    Slot slot;
    const size_t size = slot_size();
    if (!storage_.read(offset_ + number * size, buffer_, size)) {
        return slot;
    }
    const size_t covered = at_content + content_;
    slot.erased = std::all_of(buffer_, buffer_ + size, [](uint8_t byte) { return byte == 0xFF; });
    slot.valid = get_word(buffer_) == magic && get_word(buffer_ + covered) == crc32(buffer_, covered);
    slot.sequence = get_word(buffer_ + at_sequence);
    return slot;
}

/// @return number of the valid slot written last, or -1.
int RecordStore::newest(bool *damaged) {
    const Slot first = inspect(0);
    const Slot second = inspect(1);
    *damaged = !first.valid && !second.valid && !first.erased && !second.erased;
    if (first.valid && second.valid) {
        return static_cast<int32_t>(second.sequence - first.sequence) > 0 ? 1 : 0;
    }
    return second.valid ? 1 : (first.valid ? 0 : -1);
}

RecordStore::Result RecordStore::load(uint8_t *data) {
    bool damaged = false;
    const int slot = newest(&damaged);
    if (slot < 0 || !inspect(static_cast<size_t>(slot)).valid) {
        return damaged ? Result::damaged : Result::empty;
    }
    std::memcpy(data, buffer_ + at_content, content_);
    return Result::ok;
}

bool RecordStore::damaged_slot() {
    for (size_t number = 0; number < 2; ++number) {
        const Slot slot = inspect(number);
        if (!slot.valid && !slot.erased) {
            return true;
        }
    }
    return false;
}

bool RecordStore::save(const uint8_t *data) {
    bool damaged = false;
    const int last = newest(&damaged);
    const uint32_t sequence = last < 0 ? 1 : inspect(static_cast<size_t>(last)).sequence + 1;
    const size_t target = last == 0 ? 1 : 0;
    const size_t covered = at_content + content_;
    put_word(buffer_, magic);
    put_word(buffer_ + at_sequence, sequence);
    std::memcpy(buffer_ + at_content, data, content_);
    put_word(buffer_ + covered, crc32(buffer_, covered));
    if (!storage_.write(offset_ + target * slot_size(), buffer_, slot_size())) {
        return false;
    }
    const Slot written = inspect(target);
    return written.valid && written.sequence == sequence;
}

} // namespace omni
