// SPDX-License-Identifier: MIT
/// @file parts.h  The emulated board's clock, storage, watchdog and what survives a reset.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"

namespace omni {

/// The free-running timer made 64 bits wide: exact if read at least every 171 s.
class TimerClock final : public Clock {
public:
    /// @param catch_up robot time moves on only by set(): after a busy period of the host the guest's time
    /// jumps, as no robot's does.
    void start(bool catch_up);
    uint64_t now_us() override { return catch_up_ ? set_us_ : elapsed_us(); }
    uint64_t stopwatch_ns() override;
    /// Time since start() by the hardware.
    uint64_t elapsed_us();
    void set(uint64_t now_us) { set_us_ = now_us; }

private:
    uint64_t elapsed_ticks();

    bool catch_up_ = false;
    uint64_t set_us_ = 0;
    uint64_t ticks_ = 0;
    uint32_t seen_ = 0;
};

/// Non-volatile memory in a file of the host, or in memory only. A write that fails leaves what was there before.
class HostStorage final : public Storage {
public:
    /// @param path nullptr: forgotten at the end. @return false after saying why on the console.
    bool open(const char *path);
    size_t size() override { return sizeof bytes_; }
    bool read(size_t offset, uint8_t *data, size_t length) override;
    bool write(size_t offset, const uint8_t *data, size_t length) override;

private:
    /// Write all of it to the file.
    bool put();

    uint8_t bytes_[2048] = {};
    const char *path_ = nullptr;
};

/// The CMSDK watchdog. Its first timeout records the cause and resets.
class TimerWatchdog final : public Watchdog {
public:
    /// @param milliseconds 0: off. @param first reset cause after power-on.
    void start(uint32_t milliseconds, ResetCause first);
    void feed() override;
    /// Hold it while the machine stands still.
    void pause();
    void resume();
    ResetCause reset_cause() override { return cause_; }
    const char *crash_line(size_t number) override;
    void reset() override;

private:
    ResetCause cause_ = ResetCause::power_on;
    uint32_t load_ = 0;
};

} // namespace omni
