// SPDX-License-Identifier: MIT
/// @file burst_recorder.h  A second of a drive as fast as the control tick runs, in the robot's memory, to be fetched
/// afterwards.
///
/// The tick copies words of its report into the board's memory, and nothing else: no conversion, no scaling. The
/// background prepares what is copied and seals the recording with a CRC when it is over. What is fetched is one file:
/// header, columns, samples, CRC-32 (docs/reference/burst.md has every byte).
///
///     idle --prepare()--> waiting --trigger()--> recording --> recorded --serve()--> complete
///
/// A recording ends by itself when all its samples are there. stop() ends it earlier, with the samples it has.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "app/base/core.h"
#include "app/tick/tick_report.h"

namespace omni {

/// Bits of what can be recorded; a bit per wheel decides which wheels.
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
        1 << 8, ///< how long the tick before took; not in host-in-the-loop, where equal input gives equal output
    burst_all_signals = (1 << 9) - 1
};

/// What to record.
struct BurstPlan {
    uint32_t samples = 0;
    uint16_t every = 1;   ///< ticks from one sample to the next
    uint16_t signals = 0; ///< BurstSignal bits; the time is always there
    uint8_t wheels = 0;   ///< bit per wheel
};

/// How it ended.
enum class BurstEnd : uint8_t { complete = 0, stopped = 1 };

class BurstRecorder {
public:
    /// Board's memory, aligned to 8 bytes. @param size 0: there is none, and nothing can be recorded.
    void attach(uint8_t *memory, size_t size);
    /// Background: samples of these signals that the memory holds.
    uint32_t capacity(const BurstPlan &plan) const;
    /// Background: forget what was recorded, and be ready for this. @return false if it does not fit; nothing has
    /// changed then.
    bool prepare(const BurstPlan &plan, const omni_robot_config_t &config);
    /// From both sides: begin if it waits for that.
    void trigger() { change(State::waiting, State::recording); }
    /// Background: end a recording with the samples it has; forget one that waits.
    void stop();
    /// Background: forget a complete recording. @return false if there is none.
    bool erase() { return change(State::complete, State::idle); }
    /// Only while no tick runs: forget what is not complete.
    void restart();
    /// Background: seal what is recorded, a piece per call.
    void serve();

    bool busy() const { return state() != State::idle && state() != State::complete; }
    /// The whole file; 0 bytes unless it is complete.
    size_t size() const { return state() == State::complete ? size_ : 0; }
    const uint8_t *data() const { return memory_; }

    /// Tick: whether sample() wants this tick's report.
    bool recording() const { return state() == State::recording; }
    /// Tick: take a sample of every so many reports.
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
    uint16_t offsets_[most_columns] = {}; ///< in words, of each column in TickReport
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
    size_t size_ = 0;         ///< of the file
    size_t sealed_ = 0;       ///< bytes that the CRC has
    uint32_t crc_ = 0;
};

} // namespace omni
