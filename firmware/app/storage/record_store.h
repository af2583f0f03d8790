// SPDX-License-Identifier: MIT
/// @file record_store.h  One small record in non-volatile memory, in two slots (two_slots.h).
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/storage/storage_layout.h"
#include "app/storage/two_slots.h"

namespace omni {

class RecordStore : public TwoSlots<RecordStore> {
public:
    static constexpr size_t max_content = key_content;
    enum class Result : uint8_t {
        ok,
        empty,   ///< never written, or the first write was cut short
        damaged, ///< both slots were written once, and neither is valid now
    };

    /// @param offset of slot 0; slot 1 follows. @param content bytes of the record, at most max_content.
    RecordStore(Storage &storage, size_t offset, size_t content)
        : TwoSlots(storage), offset_(offset), content_(content) {}

    /// Load the record. @param data out: `content` bytes, unchanged unless ok.
    Result load(uint8_t *data);
    /// Store the record. @return false on a write error; the old content is then still valid.
    bool save(const uint8_t *data);

private:
    friend class TwoSlots<RecordStore>;
    static constexpr size_t max_slot = record_overhead + max_content;
    size_t slot_size() const { return record_overhead + content_; }
    size_t place() const { return offset_; }
    Slot judge() const;

    size_t offset_;
    size_t content_;
    uint8_t buffer_[max_slot] = {};
};

} // namespace omni
