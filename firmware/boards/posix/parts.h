// SPDX-License-Identifier: MIT
/// @file parts.h  The PC board's clock, storage and watchdog.
#pragma once

#include <climits>
#include <cstddef>
#include <cstdint>

#include "boards/common/no_hardware.h"

namespace omni {

/// Robot time that main() moves on tick by tick. So a PC that was busy for a while runs the missed ticks at their due
/// times; time does not jump.
class PosixClock final : public Clock {
public:
    uint64_t now_us() override { return now_us_; }
    uint64_t stopwatch_ns() override;
    void set(uint64_t now_us) { now_us_ = now_us; }

private:
    uint64_t now_us_ = 0;
};

/// Non-volatile memory in a file, or in memory only. Every write goes to the disk before it counts: a whole new file
/// beside the old one, which then takes its place. One that fails leaves what was there before, in the file as well.
class FileStorage final : public Storage {
public:
    /// @param path nullptr: forgotten at the end. @return false after saying why on standard error: no such folder, or
    /// another process has it open.
    bool open(const char *path);
    void close_file();
    size_t size() override { return sizeof bytes_; }
    bool read(size_t offset, uint8_t *data, size_t length) override;
    bool write(size_t offset, const uint8_t *data, size_t length) override;

private:
    /// @return false if another process has the file.
    bool lock(int fd) const;
    /// Write the new file and give it the old one's name. @return false with errno set; the old one is as it was.
    bool put(const uint8_t *content, int *fd) const;
    bool replace(const uint8_t *content);
    void sync_folder() const;

    uint8_t bytes_[2048] = {};
    char path_[PATH_MAX] = {};
    char part_[PATH_MAX] = {};
    int fd_ = -1; ///< holds the lock
};

/// No watchdog; main() performs resets.
class NoWatchdog final : public Watchdog {
public:
    void feed() override {}
    ResetCause reset_cause() override { return ResetCause::power_on; }
    const char *crash_line(size_t) override { return nullptr; }
    void reset() override {}
};

} // namespace omni
