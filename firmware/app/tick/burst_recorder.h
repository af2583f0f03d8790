// SPDX-License-Identifier: MIT
/// @file burst_recorder.h  Burst recorder: signals at the tick rate into RAM, downloaded afterwards.
///
/// The tick only copies words of its report. The background prepares the columns and adds the CRC at the end. The
/// result is one file: header, columns, samples, CRC-32 (docs/reference/burst.md).
///
///     idle --prepare()--> waiting --trigger()--> recording --> recorded --serve()--> complete
///
/// A recording ends when it has all samples, or by stop() with the samples so far.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "app/base/core.h"
#include "app/tick/tick_report.h"

namespace omni {

/// Recordable signals, one bit each; wheels are selected separately.
enum BurstSignal : uint16_t {
    burst_wheel_reference = 1 << 0, ///< rad/s
    burst_wheel_speed = 1 << 1,     ///< estimate [rad/s]
    burst_duty = 1 << 2,            ///< in the wheel's direction
    burst_voltage = 1 << 3,         ///< [V] in the wheel's direction
    burst_wheel_angle = 1 << 4,     ///< counts as read; the scale makes radians of them
    burst_pose = 1 << 5,
    burst_pose_reference = 1 << 6,
    burst_supply = 1 << 7,
    burst_tick_time =
        1 << 8, ///< duration of the previous tick; not in hardware-in-the-loop, which must be deterministic
    burst_all_signals = (1 << 9) - 1
};

/// Configuration of a recording.
struct BurstPlan {
    uint32_t samples = 0;
    uint16_t every = 1;   ///< decimation: ticks per sample
    uint16_t signals = 0; ///< BurstSignal bits; time is always recorded
    uint8_t wheels = 0;   ///< bit per wheel
};

/// End of a recording.
enum class BurstEnd : uint8_t { complete = 0, stopped = 1 };

class BurstRecorder {
public:
    /// Set the memory, aligned to 8 bytes. @param size 0: none, recording is not possible.
    void attach(uint8_t *memory, size_t size);
    /// Background: number of samples of these signals that fit in memory.
    uint32_t capacity(const BurstPlan &plan) const;
    /// Background: discard the last recording and prepare a new one. @return false if it does not fit; unchanged then.
    bool prepare(const BurstPlan &plan, const omni_robot_config_t &config);
    /// Tick or background: start a prepared recording.
    void trigger() { change(State::waiting, State::recording); }
    /// Background: end a recording with the samples so far; discard a prepared one.
    void stop();
    /// Background: discard a complete recording. @return false if there is none.
    bool erase() { return change(State::complete, State::idle); }
    /// Only while no tick runs: discard an incomplete recording.
    void restart();
    /// Background: compute the CRC of a finished recording, a piece per call.
    void serve();

    bool busy() const { return state() != State::idle && state() != State::complete; }
    /// Size of the file; 0 unless complete.
    size_t size() const { return state() == State::complete ? size_ : 0; }
    const uint8_t *data() const { return memory_; }

    /// Tick: is a recording running?
    bool recording() const { return state() == State::recording; }
    /// Tick: record a sample, every `every` reports.
    void sample(const TickReport &report);

private:
    enum class State : uint8_t { idle, waiting, recording, recorded, complete };
    static constexpr size_t most_columns = 1 + 5 * OMNI_MAX_WHEELS + 2 * OMNI_AXES + 2;

    State state() const { return state_.load(std::memory_order_acquire); }
    bool change(State from, State to) { return state_.compare_exchange_strong(from, to, std::memory_order_acq_rel); }
    void write_columns(const BurstPlan &plan, const omni_robot_config_t &config);
    void write_header();

    uint8_t *memory_ = nullptr;
    size_t memory_size_ = 0;
    std::atomic<State> state_{State::idle};
    std::atomic<bool> stop_{false};
    uint16_t offsets_[most_columns] = {}; ///< word offset of each column in TickReport
    size_t columns_ = 0;
    uint16_t every_ = 1;
    uint16_t left_ = 0; ///< reports until the next sample
    uint16_t number_ = 0;
    uint32_t wanted_ = 0;
    uint32_t taken_ = 0;
    uint64_t start_us_ = 0;
    uint16_t first_config_ = 0;
    uint16_t last_config_ = 0;
    uint8_t *next_ = nullptr; ///< where the next sample goes
    size_t size_ = 0;         ///< file size
    size_t sealed_ = 0;       ///< bytes in `crc_`
    uint32_t crc_ = 0;
};

} // namespace omni
