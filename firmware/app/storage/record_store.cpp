// SPDX-License-Identifier: MIT
#include "app/storage/record_store.h"

#include <algorithm>
#include <cstring>

#include "app/base/crc32.h"
#include "app/base/flash_code.h"
#include "app/base/u32_bytes.h"

namespace omni {
namespace {

constexpr uint32_t magic = 0x32524D4F; // "OMR2"
constexpr size_t at_content = 4;
constexpr size_t max_size = record_overhead + RecordStore::max_content;

} // namespace

RecordStore::Result RecordStore::load(uint8_t *data) {
    uint8_t bytes[max_size];
    if (!storage_.read(offset_, bytes, size())) {
        return Result::damaged;
    }
    if (std::all_of(bytes, bytes + size(), [](uint8_t byte) { return byte == 0xFF; })) {
        return Result::empty;
    }
    const size_t covered = at_content + content_;
    if (read_u32(bytes) != magic || read_u32(bytes + covered) != crc32(bytes, covered)) {
        return Result::damaged;
    }
    std::memcpy(data, bytes + at_content, content_);
    return Result::ok;
}

OMNI_COLD bool RecordStore::save(const uint8_t *data) {
    uint8_t bytes[max_size];
    const size_t covered = at_content + content_;
    write_u32(bytes, magic);
    std::memcpy(bytes + at_content, data, content_);
    write_u32(bytes + covered, crc32(bytes, covered));
    uint8_t stored[max_content];
    return storage_.write(offset_, bytes, size()) && load(stored) == Result::ok &&
           std::memcmp(stored, data, content_) == 0;
}

} // namespace omni
