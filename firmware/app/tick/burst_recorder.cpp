// SPDX-License-Identifier: MIT
#include "app/tick/burst_recorder.h"

#include <cstddef>
#include <cstring>

#include "app/base/crc32.h"
#include "app/base/flash_code.h"

namespace omni {
namespace {

constexpr uint16_t version = 1;
constexpr size_t word = 4;
/// Bytes per call of serve(): 0.1 ms on a Teensy.
constexpr size_t seal_piece = 512;

enum class ColumnType : uint8_t { real = 0, signed_int = 1, unsigned_int = 2 };

struct Header {
    char magic[4];
    uint16_t version;
    uint16_t bytes; ///< of the header with its columns
    uint64_t start_us;
    uint32_t samples;
    uint16_t sample_bytes;
    uint16_t every;
    uint16_t tick_us;
    uint16_t number;
    uint16_t first_config;
    uint16_t last_config;
    uint8_t columns;
    uint8_t end;
    uint8_t reserved[6];
};
static_assert(sizeof(Header) == 40 && offsetof(Header, samples) == 16 && offsetof(Header, columns) == 32,
              "docs/reference");

struct Column {
    char name[16];
    char unit[8];
    float scale;
    uint8_t type;
    uint8_t index; ///< of the wheel or axis
    uint8_t reserved[2];
};
static_assert(sizeof(Column) == 32, "docs/reference");

enum class Per : uint8_t { robot, wheel, axis };

struct Signal {
    uint16_t bit; ///< 0: always there
    Per per;
    ColumnType type;
    const char *name;
    const char *unit;
    size_t offset; ///< in TickReport
};

constexpr size_t in_outputs(size_t offset) {
    return offsetof(TickReport, outputs) + offset;
}

constexpr Signal signals[] = {
    {0, Per::robot, ColumnType::unsigned_int, "time", "s", in_outputs(offsetof(omni_outputs_t, time_us))},
    {burst_wheel_reference, Per::wheel, ColumnType::real, "wheel_reference", "rad/s",
     in_outputs(offsetof(omni_outputs_t, wheel_reference))},
    {burst_wheel_speed, Per::wheel, ColumnType::real, "wheel_speed", "rad/s",
     in_outputs(offsetof(omni_outputs_t, wheel_rad_s))},
    {burst_duty, Per::wheel, ColumnType::real, "duty", "", in_outputs(offsetof(omni_outputs_t, duty))},
    {burst_voltage, Per::wheel, ColumnType::real, "voltage", "V", in_outputs(offsetof(omni_outputs_t, voltage_V))},
    {burst_wheel_angle, Per::wheel, ColumnType::signed_int, "wheel_angle", "rad", offsetof(TickReport, counts)},
    {burst_pose, Per::axis, ColumnType::real, "pose", "m", in_outputs(offsetof(omni_outputs_t, pose))},
    {burst_pose_reference, Per::axis, ColumnType::real, "pose_reference", "m",
     in_outputs(offsetof(omni_outputs_t, reference.pose))},
    {burst_supply, Per::robot, ColumnType::real, "supply", "V", in_outputs(offsetof(omni_outputs_t, supply_V))},
    {burst_tick_time, Per::robot, ColumnType::unsigned_int, "tick_time", "s", offsetof(TickReport, last_tick_ns)},
};

/// Scale factor of a recorded word.
OMNI_COLD float scale_of(const Signal &signal, size_t index, const omni_robot_config_t &config) {
    switch (signal.bit) {
    case 0:
        return 1e-6f;
    case burst_tick_time:
        return 1e-9f;
    case burst_duty:
        return config.motor_direction[index];
    case burst_wheel_angle:
        return static_cast<float>(config.encoder_direction[index]) * config.rad_per_count;
    default:
        return 1.0f;
    }
}

OMNI_COLD size_t entries_of(const Signal &signal) {
    switch (signal.per) {
    case Per::wheel:
        return OMNI_MAX_WHEELS;
    case Per::axis:
        return OMNI_AXES;
    default:
        return 1;
    }
}

OMNI_COLD bool is_wanted(const Signal &signal, size_t index, const BurstPlan &plan) {
    const bool chosen = signal.bit == 0 || (plan.signals & signal.bit) != 0;
    return chosen && (signal.per != Per::wheel || (plan.wheels >> index & 1) != 0);
}

OMNI_COLD size_t count_columns(const BurstPlan &plan) {
    size_t count = 0;
    for (const Signal &signal : signals) {
        for (size_t i = 0; i < entries_of(signal); ++i) {
            count += is_wanted(signal, i, plan) ? 1 : 0;
        }
    }
    return count;
}

OMNI_COLD Column column_of(const Signal &signal, size_t index, const omni_robot_config_t &config) {
    Column column{};
    const bool angle = signal.per == Per::axis && index == OMNI_AXES - 1;
    std::strncpy(column.name, signal.name, sizeof column.name - 1);
    std::strncpy(column.unit, angle ? "rad" : signal.unit, sizeof column.unit - 1);
    column.scale = scale_of(signal, index, config);
    column.type = static_cast<uint8_t>(signal.type);
    column.index = static_cast<uint8_t>(index);
    return column;
}

} // namespace

OMNI_COLD void BurstRecorder::attach(uint8_t *memory, size_t size) {
    memory_ = memory;
    memory_size_ = size;
}

OMNI_COLD void BurstRecorder::write_columns(const BurstPlan &plan, const omni_robot_config_t &config) {
    columns_ = 0;
    for (const Signal &signal : signals) {
        for (size_t i = 0; i < entries_of(signal); ++i) {
            if (is_wanted(signal, i, plan)) {
                const Column column = column_of(signal, i, config);
                std::memcpy(memory_ + sizeof(Header) + columns_ * sizeof column, &column, sizeof column);
                offsets_[columns_++] = static_cast<uint16_t>(signal.offset / word + i);
            }
        }
    }
}

OMNI_COLD uint32_t BurstRecorder::capacity(const BurstPlan &plan) const {
    const size_t columns = count_columns(plan);
    const size_t around = sizeof(Header) + columns * sizeof(Column) + sizeof crc_;
    return memory_size_ < around ? 0 : static_cast<uint32_t>((memory_size_ - around) / (columns * word));
}

OMNI_COLD bool BurstRecorder::prepare(const BurstPlan &plan, const omni_robot_config_t &config) {
    if (state() == State::recording || plan.samples == 0 || plan.samples > capacity(plan)) {
        return false;
    }
    state_.store(State::idle, std::memory_order_release);
    write_columns(plan, config);
    every_ = plan.every;
    left_ = 0;
    wanted_ = plan.samples;
    taken_ = 0;
    sealed_ = 0;
    crc_ = 0;
    next_ = memory_ + sizeof(Header) + columns_ * sizeof(Column);
    ++number_;
    stop_.store(false, std::memory_order_relaxed);
    state_.store(State::waiting, std::memory_order_release);
    return true;
}

OMNI_COLD void BurstRecorder::stop() {
    if (!change(State::waiting, State::idle)) {
        stop_.store(true, std::memory_order_relaxed);
    }
}

OMNI_COLD void BurstRecorder::restart() {
    if (state() != State::complete) {
        state_.store(State::idle, std::memory_order_release);
    }
}

OMNI_COLD void BurstRecorder::write_header() {
    Header header{};
    std::memcpy(header.magic, "OMNB", sizeof header.magic);
    header.version = version;
    header.bytes = static_cast<uint16_t>(sizeof header + columns_ * sizeof(Column));
    header.start_us = start_us_;
    header.samples = taken_;
    header.sample_bytes = static_cast<uint16_t>(columns_ * word);
    header.every = every_;
    header.tick_us = OMNI_TICK_US;
    header.number = number_;
    header.first_config = first_config_;
    header.last_config = last_config_;
    header.columns = static_cast<uint8_t>(columns_);
    header.end = static_cast<uint8_t>(taken_ == wanted_ ? BurstEnd::complete : BurstEnd::stopped);
    std::memcpy(memory_, &header, sizeof header);
    size_ = static_cast<size_t>(next_ - memory_);
}

OMNI_COLD void BurstRecorder::serve() {
    if (state() != State::recorded) {
        return;
    }
    if (sealed_ == 0) {
        write_header();
    }
    const size_t piece = size_ - sealed_ < seal_piece ? size_ - sealed_ : seal_piece;
    crc_ = crc32(memory_ + sealed_, piece, crc_);
    sealed_ += piece;
    if (sealed_ == size_) {
        std::memcpy(memory_ + size_, &crc_, sizeof crc_);
        size_ += sizeof crc_;
        state_.store(State::complete, std::memory_order_release);
    }
}

void BurstRecorder::sample(const TickReport &report) {
    if (stop_.load(std::memory_order_relaxed)) {
        state_.store(taken_ == 0 ? State::idle : State::recorded, std::memory_order_release);
        return;
    }
    if (left_ != 0) {
        --left_;
        return;
    }
    left_ = static_cast<uint16_t>(every_ - 1);
    const auto *words = reinterpret_cast<const uint8_t *>(&report);
    for (size_t i = 0; i < columns_; ++i) {
        std::memcpy(next_ + i * word, words + offsets_[i] * word, word);
    }
    next_ += columns_ * word;
    if (taken_ == 0) {
        start_us_ = report.outputs.time_us;
        first_config_ = report.outputs.config_sequence;
    }
    last_config_ = report.outputs.config_sequence;
    if (++taken_ == wanted_) {
        state_.store(State::recorded, std::memory_order_release);
    }
}

} // namespace omni
