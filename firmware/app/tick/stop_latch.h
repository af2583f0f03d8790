// SPDX-License-Identifier: MIT
/// @file stop_latch.h  E-stop latch in non-volatile memory: survives reboots, crashes and power cuts; cleared by a
/// release only.
///
/// The motors stop first, then the memory is written: at once for a stop, `release_delay_us` after a release, never
/// while armed. So a power cut may restore a stop that was just released, never the reverse. The delay limits wear to
/// two writes per `release_delay_us`.
///
/// Fail-safe: a damaged record, a memory whose last write was cut short, or an unreadable memory counts as stopped, and
/// the stop is written at once. The remaining gap is a power cut before the first byte is written, less than a
/// background pass after the stop.
#pragma once

#include "app/storage/record_store.h"

namespace omni {

class StopLatch {
public:
    static constexpr uint64_t release_delay_us = 500'000;
    static constexpr uint64_t retry_us = 1'000'000;
    enum class AtBoot : uint8_t { released, stopped, unknown };

    explicit StopLatch(Storage &storage);

    /// Read the memory. @return unknown: not readable, counts as stopped.
    AtBoot boot();
    AtBoot at_boot() const { return at_boot_; }
    /// Once per background pass. @param stopped in e-stop. @param resting disarmed: the memory may be written. @param
    /// hurry a restart is pending: write now. @param now_us robot clock; may restart.
    void serve(bool stopped, bool resting, bool hurry, uint64_t now_us);
    /// The last write failed; retried every `retry_us`.
    bool failed() const { return failed_; }

private:
    bool due(bool stopped, bool resting, bool hurry, uint64_t now_us);

    Storage &storage_;
    RecordStore store_;
    AtBoot at_boot_ = AtBoot::released;
    bool stored_ = false; ///< state in memory: stopped
    bool failed_ = false;
    uint64_t since_us_ = 0; ///< time of the latest stop or failure
};

} // namespace omni
