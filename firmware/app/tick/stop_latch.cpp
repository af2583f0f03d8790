// SPDX-License-Identifier: MIT
#include "app/tick/stop_latch.h"

#include "app/base/u32_bytes.h"

namespace omni {
namespace {

constexpr uint32_t word_stopped = 0x504F5453;  // "STOP"
constexpr uint32_t word_released = 0x454D4F43; // "COME"

/// Offset of the record; with a memory that is too small every access fails.
size_t place_in(Storage &storage) {
    const size_t size = storage.size();
    return size >= storage_tail ? size - latch_record : size;
}

} // namespace

StopLatch::StopLatch(Storage &storage) : storage_(storage), store_(storage, place_in(storage), latch_content) {}

StopLatch::AtBoot StopLatch::boot() {
    uint8_t content[latch_content] = {};
    const RecordStore::Result found = store_.load(content);
    if (storage_.may_hold_unreadable_data() || found == RecordStore::Result::damaged) {
        at_boot_ = AtBoot::unknown;
    } else if (found == RecordStore::Result::ok && read_u32(content) != word_released) {
        at_boot_ = AtBoot::stopped;
    } else {
        at_boot_ = AtBoot::released;
    }
    // In doubt the stop is written before anything else: the next write of anybody would end the doubt.
    stored_ = found == RecordStore::Result::ok && read_u32(content) != word_released;
    return at_boot_;
}

bool StopLatch::due(bool stopped, bool resting, bool hurry, uint64_t now_us) {
    if (now_us < since_us_) {
        since_us_ = now_us;
    }
    if (stopped == stored_ || (!stopped && !resting)) {
        since_us_ = stopped ? now_us : since_us_;
        return false;
    }
    const uint64_t delay_us = failed_ ? retry_us : release_delay_us;
    return hurry || (stopped && !failed_) || now_us - since_us_ >= delay_us;
}

void StopLatch::serve(bool stopped, bool resting, bool hurry, uint64_t now_us) {
    if (!due(stopped, resting, hurry, now_us)) {
        return;
    }
    uint8_t content[latch_content];
    write_u32(content, stopped ? word_stopped : word_released);
    failed_ = !store_.save(content);
    stored_ = failed_ ? stored_ : stopped;
    since_us_ = now_us;
}

} // namespace omni
