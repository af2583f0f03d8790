// SPDX-License-Identifier: MIT
/// @file two_slots.h  Content in non-volatile memory, in two slots written in turn. A power cut at any byte leaves the
/// old or the new content, never a mix. The rules are those of docs/reference/storage.md, for every format that is kept
/// like that.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"

namespace omni {

/// What a slot holds.
struct Slot {
    bool valid = false;    ///< whole, with the right mark and CRC
    bool erased = false;   ///< never written
    uint32_t sequence = 0; ///< of valid ones the later counts
};

/// `Format` derives from this and knows its bytes. `slot_size()` and `place()` say where slot 0 is; slot 1 follows.
/// `buffer_` takes a slot, and `judge()` says what it holds.
template <class Format>
class TwoSlots {
public:
    /// A slot is neither valid nor erased, as a power cut while writing leaves it, or cannot be read.
    bool damaged_slot() { return is_damaged(inspect(0)) || is_damaged(inspect(1)); }

protected:
    explicit TwoSlots(Storage &storage) : storage_(storage) {}

    static bool is_damaged(const Slot &slot) { return !slot.valid && !slot.erased; }

    /// Reads the slot into the buffer and judges it.
    Slot inspect(size_t number) {
        const size_t size = format().slot_size();
        return storage_.read(format().place() + number * size, format().buffer_, size) ? format().judge() : Slot{};
    }

    /// Reads the valid slot written last into the buffer. @return false if there is none.
    bool read_newest() {
        const int slot = newest();
        return slot >= 0 && inspect(static_cast<size_t>(slot)).valid;
    }

    /// Has `compose` fill the buffer and writes it into the slot that does not count. The other one stays untouched.
    /// @param compose takes the sequence number, returns how many bytes to write, 0: none. @return false if the memory
    /// did not take it.
    template <class Compose>
    bool write_next(const Compose &compose) {
        const int last = newest();
        const uint32_t sequence = last < 0 ? 1 : inspect(static_cast<size_t>(last)).sequence + 1;
        const size_t target = last == 0 ? 1 : 0;
        const size_t length = compose(sequence);
        if (length == 0 ||
            !storage_.write(format().place() + target * format().slot_size(), format().buffer_, length)) {
            return false;
        }
        const Slot written = inspect(target);
        return written.valid && written.sequence == sequence;
    }

    Storage &storage_;

private:
    Format &format() { return static_cast<Format &>(*this); }

    /// @return number of the valid slot written last, or -1.
    int newest() {
        const Slot first = inspect(0);
        const Slot second = inspect(1);
        if (first.valid && second.valid) {
            return static_cast<int32_t>(second.sequence - first.sequence) > 0 ? 1 : 0;
        }
        return second.valid ? 1 : (first.valid ? 0 : -1);
    }
};

} // namespace omni
