// SPDX-License-Identifier: MIT
/// @file record_store.h  One small record in non-volatile memory. Storage writes are atomic: a power cut leaves the old
/// or the new record.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"
#include "app/storage/storage_layout.h"

namespace omni {

class RecordStore {
public:
    static constexpr size_t max_content = key_content;
    enum class Result : uint8_t {
        ok,
        empty,   ///< never written
        damaged, ///< written, but it cannot be read
    };

    /// @param offset of the record. @param content bytes of the record, at most max_content.
    RecordStore(Storage &storage, size_t offset, size_t content)
        : storage_(storage), offset_(offset), content_(content) {}

    /// Load the record. @param data out: `content` bytes, unchanged unless ok.
    Result load(uint8_t *data);
    /// Store the record, and verify by reading back. @return false on a write error.
    bool save(const uint8_t *data);

private:
    size_t size() const { return record_overhead + content_; }

    Storage &storage_;
    size_t offset_;
    size_t content_;
};

} // namespace omni
