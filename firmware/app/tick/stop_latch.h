// SPDX-License-Identifier: MIT
/// @file stop_latch.h  The emergency stop in non-volatile memory: it outlives reboots, crashes and power cuts. Only a
/// release ends it.
///
/// The motors stop first, then the memory is written: at once for a stop, `release_delay_us` after a release, and not
/// while armed. So what is stored may be a stop that was released shortly before, never the other way round. Somebody
/// who stops and releases all day wears the memory no more than twice per delay.
///
/// In doubt the robot comes up stopped. A slot that is neither erased nor valid was being written when the power went.
/// A memory that cannot be read may hold a stop. What remains is a power cut before the first byte is written, less
/// than a background pass after the stop.
#pragma once

#include "app/storage/record_store.h"

namespace omni {

class StopLatch {
public:
    static constexpr uint64_t release_delay_us = 500'000;
    static constexpr uint64_t retry_us = 1'000'000;
    enum class AtBoot : uint8_t { released, stopped, unknown };

    explicit StopLatch(Storage &storage);

    /// Read the memory. @return unknown: nobody can tell, so it counts as stopped.
    AtBoot boot();
    AtBoot at_boot() const { return at_boot_; }
    /// Once per background pass. @param stopped the motors are off and stay so until a release. @param resting
    /// disarmed: the memory may be written. @param hurry a restart is due. @param now_us robot clock; it may start
    /// over.
    void serve(bool stopped, bool resting, bool hurry, uint64_t now_us);
    /// The memory did not take the last stop or release; tried again every `retry_us`.
    bool failed() const { return failed_; }

private:
    bool due(bool stopped, bool resting, bool hurry, uint64_t now_us);

    Storage &storage_;
    RecordStore store_;
    AtBoot at_boot_ = AtBoot::released;
    bool stored_ = false; ///< the memory says stopped
    bool failed_ = false;
    uint64_t since_us_ = 0; ///< of the latest stop, or of the latest failure
};

} // namespace omni
