// SPDX-License-Identifier: MIT
/// @file watchdog.h  The RT watchdog (WDOG3), the reset cause, and the fault handler's crash record.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "app/base/board.h"
#include "app/base/text.h"

namespace omni {

/// Liveness of tick and background: the background feeds the watchdog only if a tick has run since the last feeding.
class AliveGate {
public:
    void tick() { ticks_.fetch_add(1, std::memory_order_relaxed); }
    bool both_alive();

private:
    std::atomic<uint32_t> ticks_{0};
    uint32_t seen_ = 0;
};

/// Crash record of the fault handler.
struct CrashFacts {
    uint32_t address; ///< of the code
    uint32_t exception;
    uint32_t cfsr, hfsr;
    bool access_known;
    uint32_t access; ///< address of the data
};

/// The same as lines for people.
class CrashLines {
public:
    static constexpr size_t line_count = 3;

    void compose(const CrashFacts &facts);
    void add(const Text &line) { lines_[count_++] = line; }
    const char *line(size_t number) const { return number < count_ ? lines_[number].data() : nullptr; }

private:
    size_t count_ = 0;
    Text lines_[line_count];
};

class Teensy40Watchdog final : public Watchdog {
public:
    /// A hang of the tick or of the background ends after this.
    static constexpr uint32_t time_out_ms = 200;
    /// Longest sector erase by the flash chip's datasheet is 400 ms; interrupts are off meanwhile.
    static constexpr uint32_t erase_time_out_ms = 1000;

    /// Read the reset cause. Call it first: later code clears the registers.
    void begin();
    /// Start the watchdog. Only a reset stops it.
    void start() { configure(time_out_ms); }
    /// Bracket an operation that blocks the tick. Each call restarts the count.
    void expect_erase(bool begins) { configure(begins ? erase_time_out_ms : time_out_ms); }
    /// The timer's tick, to be called in every one.
    void tick() { alive_.tick(); }

    void feed() override;
    ResetCause reset_cause() override { return cause_; }
    const char *crash_line(size_t number) override { return crash_.line(number); }
    [[noreturn]] void reset() override;

private:
    void configure(uint32_t time_out_ms);
    void take_fault();

    AliveGate alive_;
    ResetCause cause_ = ResetCause::power_on;
    CrashLines crash_;
    bool started_ = false;
};

} // namespace omni
