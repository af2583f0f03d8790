// SPDX-License-Identifier: MIT
#include "boards/mps2_an500/parts.h"

#include <algorithm>
#include <cstdio>
#include <cstring>

#include "boards/mps2_an500/base/fault.h"
#include "boards/mps2_an500/base/machine.h"
#include "boards/mps2_an500/base/semihosting.h"
#include "boards/mps2_an500/reset_record.h"

namespace omni {

void TimerClock::start(bool catch_up) {
    catch_up_ = catch_up;
    an500::start_free_timer();
    seen_ = an500::clock_ticks();
}

uint64_t TimerClock::elapsed_ticks() {
    const an500::InterruptLock lock; // both the tick and the background come here
    const uint32_t now = an500::clock_ticks();
    ticks_ += now - seen_;
    seen_ = now;
    return ticks_;
}

uint64_t TimerClock::elapsed_us() {
    return elapsed_ticks() / (an500::clock_Hz / 1'000'000);
}

uint64_t TimerClock::stopwatch_ns() {
    return elapsed_ticks() * an500::ns_per_clock;
}

bool HostStorage::open(const char *path) {
    std::memset(bytes_, 0xFF, sizeof bytes_);
    path_ = path;
    if (path == nullptr) {
        return true;
    }
    int file = an500::semihosting_open(path, an500::OpenMode::read);
    if (file < 0) {
        file = an500::semihosting_open(path, an500::OpenMode::append); // a new one
    }
    // A file shorter than the memory is one that was never written to its end: the rest counts as erased.
    if (file < 0 || an500::semihosting_read(file, bytes_, sizeof bytes_) < 0) {
        std::fprintf(stderr, "omni-firmware: --storage %s: %s\n", path, std::strerror(an500::semihosting_errno()));
        return false;
    }
    return an500::semihosting_close(file);
}

bool HostStorage::read(size_t offset, uint8_t *data, size_t length) {
    if (offset > sizeof bytes_ || length > sizeof bytes_ - offset) {
        return false;
    }
    std::memcpy(data, bytes_ + offset, length);
    return true;
}

bool HostStorage::write(size_t offset, const uint8_t *data, size_t length) {
    if (offset > sizeof bytes_ || length > sizeof bytes_ - offset) {
        return false;
    }
    uint8_t before[sizeof bytes_];
    std::memcpy(before, bytes_, sizeof bytes_);
    std::memcpy(bytes_ + offset, data, length);
    if (path_ == nullptr || put()) {
        return true;
    }
    // Some of it may have got there, and must not come back at the next start.
    std::memcpy(bytes_, before, sizeof bytes_);
    if (!put()) {
        std::fprintf(stderr, "omni-firmware: the storage file cannot be put back\n");
    }
    return false;
}

bool HostStorage::put() {
    const int file = an500::semihosting_open(path_, an500::OpenMode::read_write);
    if (file < 0) {
        return false;
    }
    // From the beginning, so that a young file has no hole of zeros in front.
    const int count = an500::semihosting_write(file, bytes_, sizeof bytes_);
    return an500::semihosting_close(file) && count == static_cast<int>(sizeof bytes_);
}

void TimerWatchdog::start(uint32_t milliseconds, ResetCause first) {
    cause_ = read_reset_record(first);
    load_ = milliseconds * (an500::clock_Hz / 1000);
    resume();
}

void TimerWatchdog::pause() {
    an500::watchdog_timer().control = 0;
}

void TimerWatchdog::resume() {
    if (load_ > 0) {
        an500::watchdog_timer().load = load_;
        an500::watchdog_timer().control = an500::watchdog_interrupt_enable | an500::watchdog_reset_enable;
    }
}

void TimerWatchdog::feed() {
    if (load_ > 0) {
        an500::watchdog_timer().load = load_;
    }
}

const char *TimerWatchdog::crash_line(size_t number) {
    return cause_ == ResetCause::crash ? recorded_crash_line(number) : nullptr;
}

void TimerWatchdog::reset() {
    record_reset_cause(ResetCause::software);
    an500::reset_system();
}

} // namespace omni
