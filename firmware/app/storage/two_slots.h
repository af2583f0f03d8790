// SPDX-License-Identifier: MIT
/// @file two_slots.h  Power-fail safe storage in two slots written alternately: a power cut at any byte leaves the old
/// or the new content. Rules: docs/reference/storage.md.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"

namespace omni {

/// State of a slot.
struct Slot {
    bool valid = false;    ///< valid magic and CRC
    bool erased = false;   ///< never written
    uint32_t sequence = 0; ///< the valid slot with the later one is used
};

/// `Format` (CRTP) derives from this and defines the format: `slot_size()`, `place()` (offset of slot 0, slot 1
/// follows), `buffer_` for one slot, and `judge()`, which validates the buffer.
template <class Format>
class TwoSlots {
public:
    /// Is a slot neither valid nor erased (power cut while writing), or unreadable?
    bool damaged_slot() { return is_damaged(inspect(0)) || is_damaged(inspect(1)); }

protected:
    explicit TwoSlots(Storage &storage) : storage_(storage) {}

    static bool is_damaged(const Slot &slot) { return !slot.valid && !slot.erased; }

    /// Read a slot into the buffer and validate it.
    Slot inspect(size_t number) {
        const size_t size = format().slot_size();
        return storage_.read(format().place() + number * size, format().buffer_, size) ? format().judge() : Slot{};
    }

    /// Read the newest valid slot into the buffer. @return false if there is none.
    bool read_newest() {
        const int slot = newest();
        return slot >= 0 && inspect(static_cast<size_t>(slot)).valid;
    }

    /// Fill the buffer by `compose` and write it to the inactive slot.
    /// @param compose gets the sequence number, returns the number of bytes, 0: nothing to write. @return false on a
    /// write error.
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

    /// Number of the newest valid slot, or -1.
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
