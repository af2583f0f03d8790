// SPDX-License-Identifier: MIT
#include "app/drivers/register_gyro.h"

#include <algorithm>
#include <cstdlib>

#include "omni/gyro.h"

namespace omni {
namespace {

constexpr uint8_t reading_bytes = 6;
constexpr uint16_t jump_window = 1000; ///< readings
/// Threshold of jumps per window. A quarter of all bit errors is in the upper four bits and detected: three times as
/// many are not.
constexpr uint16_t jumps_allowed = 5;

constexpr uint64_t retry_us = 200'000;
/// Maximum age of a transfer: an older one was sent before a pause by hardware-in-the-loop.
constexpr uint64_t stale_us = 10'000;
constexpr uint16_t look_interval = 50; ///< readings
/// Timeout of a batch in ticks. The longest, the set-up, is 0.6 ms at 400 kHz.
constexpr uint8_t busy_limit = 5;
constexpr uint8_t failures_allowed = 10;
constexpr uint8_t invalid_allowed = 10;
constexpr uint8_t same_allowed = OMNI_GYRO_STUCK_SAMPLES;
constexpr uint8_t good_enough = OMNI_GYRO_GOOD_SAMPLES;

} // namespace

GyroTrouble RegisterGyro::trouble() const {
    const uint16_t packed = trouble_.load(std::memory_order_relaxed);
    return {static_cast<GyroCause>(packed & 0xFFu), static_cast<uint8_t>(packed >> 8), chip_.identity};
}

void RegisterGyro::set_trouble(GyroCause cause, uint8_t seen) {
    trouble_.store(static_cast<uint16_t>(static_cast<uint16_t>(cause) | seen << 8), std::memory_order_relaxed);
}

void RegisterGyro::restart_chip(uint64_t now_us, GyroCause cause, uint8_t seen) {
    set_trouble(cause, seen);
    phase_ = Phase::identify;
    good_ = 0;
    failures_ = 0;
    due_us_ = now_us + retry_us;
}

/// A change of the axis clears the history. When disabled, the batch in flight is completed, and no other is sent.
void RegisterGyro::apply_axis() {
    const int8_t wanted = requested_axis_.load(std::memory_order_relaxed);
    if (wanted == axis_) {
        return;
    }
    if (axis_ == 0 || wanted == 0) {
        phase_ = Phase::identify;
        due_us_ = 0;
        set_trouble(GyroCause::none);
    }
    axis_ = wanted;
    have_used_ = false;
    good_ = 0;
}

uint8_t RegisterGyro::read(uint64_t now_us, float *rad_s) {
    apply_axis();
    const uint8_t fresh = in_flight_ ? process_batch(now_us, rad_s) : uint8_t{0};
    if (axis_ != 0 && !in_flight_ && now_us >= due_us_) {
        send_next(now_us);
    }
    return fresh;
}

uint8_t RegisterGyro::process_batch(uint64_t now_us, float *rad_s) {
    uint8_t bytes[I2cTransaction::max_read] = {};
    const I2cStatus status = bus_.poll(bytes);
    if (status == I2cStatus::busy && ++busy_ticks_ < busy_limit) {
        return 0;
    }
    in_flight_ = false;
    busy_ticks_ = 0;
    if (axis_ == 0) {
        return 0;
    }
    if (status == I2cStatus::done) {
        return arrived(now_us, bytes, rad_s);
    }
    failed(now_us, status);
    return 0;
}

void RegisterGyro::failed(uint64_t now_us, I2cStatus status) {
    if (status != I2cStatus::nack) {
        bus_.recover();
    }
    if (phase_ != Phase::run || ++failures_ >= failures_allowed) {
        restart_chip(now_us, status == I2cStatus::nack ? GyroCause::absent : GyroCause::bus);
    }
}

uint8_t RegisterGyro::arrived(uint64_t now_us, const uint8_t *bytes, float *rad_s) {
    failures_ = 0;
    if (phase_ == Phase::identify) {
        identified(now_us, bytes[0]);
    } else if (phase_ == Phase::step) {
        step_done(now_us, bytes);
    } else if (looking_) {
        check_readback(now_us, bytes);
    } else if (now_us - sent_us_ < stale_us) {
        return process_reading(now_us, bytes, rad_s);
    }
    return 0;
}

void RegisterGyro::identified(uint64_t now_us, uint8_t seen) {
    if (seen != chip_.identity) {
        restart_chip(now_us, GyroCause::wrong_id, seen);
        return;
    }
    phase_ = Phase::step;
    step_ = 0;
    attempts_ = 0;
    uploaded_ = 0;
}

void RegisterGyro::next_step(uint64_t now_us, uint32_t wait_us) {
    due_us_ = now_us + wait_us;
    attempts_ = 0;
    if (++step_ == chip_.step_count) {
        begin_run();
    }
}

void RegisterGyro::step_done(uint64_t now_us, const uint8_t *bytes) {
    const GyroStep &step = chip_.steps[step_];
    if (step.kind == GyroStep::Kind::upload) {
        uploaded_ += upload_piece;
        if (uploaded_ < configuration_size_) {
            return;
        }
    } else if (step.kind == GyroStep::Kind::expect && (bytes[0] & step.mask) != step.value) {
        due_us_ = now_us + step.wait_us;
        if (++attempts_ == step.attempts) {
            restart_chip(now_us, GyroCause::configuration, bytes[0]);
        }
        return;
    }
    next_step(now_us, step.kind == GyroStep::Kind::expect ? 0 : step.wait_us);
}

/// Read back all settings before the first reading.
void RegisterGyro::begin_run() {
    phase_ = Phase::run;
    suspicious_ = true;
    readback_error_ = have_used_ = last_rejected_ = noisy_ = false;
    check_ = 0;
    readings_since_readback_ = 0;
    invalid_ = same_ = 0;
    window_ = jumps_ = 0;
}

/// A wrong read-back is an error only twice in a row (bit errors). The second time the settings are checked first, as a
/// chip that has lost them does not measure, either.
void RegisterGyro::check_readback(uint64_t now_us, const uint8_t *bytes) {
    const RegisterCheck &check = chip_.checks[check_];
    readings_since_readback_ = 0;
    const bool right = std::equal(bytes, bytes + check.count, check.expected,
                                  [&check](uint8_t seen, uint8_t wanted) { return (seen & check.mask) == wanted; });
    if (!right && readback_error_) {
        restart_chip(now_us, check.cause);
    } else if (!right) {
        suspicious_ = readback_error_ = true;
        check_ = 0;
    } else if (++check_ == chip_.check_count) {
        suspicious_ = readback_error_ = false;
        check_ = 0;
    }
}

int16_t RegisterGyro::value_of(const uint8_t *bytes) const {
    const uint8_t high = chip_.high_byte_first ? bytes[0] : bytes[1];
    const uint8_t low = chip_.high_byte_first ? bytes[1] : bytes[0];
    return static_cast<int16_t>(static_cast<uint16_t>(high << 8 | low));
}

bool RegisterGyro::is_jump(int16_t from, int16_t to) const {
    return std::abs(static_cast<int>(to) - static_cast<int>(from)) > jump_steps_;
}

uint8_t RegisterGyro::process_reading(uint64_t now_us, const uint8_t *bytes, float *rad_s) {
    int16_t raw[axes];
    for (size_t i = 0; i < axes; ++i) {
        raw[i] = value_of(bytes + 2 * i);
    }
    if (std::all_of(raw, raw + axes, [this](int16_t value) { return value == chip_.no_reading; })) {
        suspicious_ = true;
        if (++invalid_ >= invalid_allowed) {
            restart_chip(now_us, GyroCause::silent);
        }
        return 0;
    }
    invalid_ = 0;
    const int16_t own = raw[std::abs(axis_) - 1];
    const bool jumped = jumps(own);
    if (stands_still(raw)) {
        restart_chip(now_us, GyroCause::stuck);
        return 0;
    }
    count_jump(jumped);
    if (jumped || noisy_) {
        return 0;
    }
    judge(own);
    for (size_t i = 0; i < axes; ++i) {
        rad_s[i] = static_cast<float>(raw[i]) * chip_.rad_s_per_step;
    }
    return (1u << axes) - 1u;
}

bool RegisterGyro::stands_still(const int16_t *raw) {
    same_ = std::equal(raw, raw + axes, last_) ? static_cast<uint8_t>(same_ + 1) : uint8_t{0};
    std::copy(raw, raw + axes, last_);
    return same_ >= same_allowed;
}

/// A jump is accepted if the next reading confirms it.
bool RegisterGyro::jumps(int16_t raw) {
    const int16_t before = last_[std::abs(axis_) - 1];
    last_rejected_ = have_used_ && is_jump(used_, raw) && (!last_rejected_ || is_jump(before, raw));
    have_used_ = true;
    used_ = last_rejected_ ? used_ : raw;
    return last_rejected_;
}

void RegisterGyro::count_jump(bool jumped) {
    jumps_ = static_cast<uint16_t>(jumps_ + (jumped ? 1 : 0));
    if (jumps_ > jumps_allowed && !noisy_) {
        noisy_ = true;
        good_ = 0;
        set_trouble(GyroCause::noisy);
    }
    if (++window_ >= jump_window) {
        noisy_ = jumps_ > jumps_allowed;
        window_ = jumps_ = 0;
    }
}

/// A saturated reading is passed on: the core checks GYRO_MAX.
void RegisterGyro::judge(int16_t raw) {
    if (raw >= chip_.end_of_range || raw <= -chip_.end_of_range) {
        good_ = 0;
        set_trouble(GyroCause::saturated);
        return;
    }
    good_ = good_ < good_enough ? static_cast<uint8_t>(good_ + 1) : good_;
    if (good_ == good_enough) {
        set_trouble(GyroCause::none);
    }
}

I2cTransaction RegisterGyro::write_of(const uint8_t *bytes, size_t count) const {
    I2cTransaction transaction;
    transaction.address = address_;
    transaction.write_length = static_cast<uint8_t>(count);
    std::copy(bytes, bytes + count, transaction.write);
    return transaction;
}

/// @return number of transactions.
size_t RegisterGyro::compile(GyroWrites writes, I2cTransaction *batch) const {
    size_t count = 0;
    while (writes != nullptr && *writes != 0 && count < GyroRegisters::max_writes) {
        batch[count++] = write_of(writes + 1, *writes);
        writes += 1 + *writes;
    }
    return count;
}

void RegisterGyro::send(uint64_t now_us, const I2cTransaction *batch, size_t count) {
    sent_us_ = now_us;
    in_flight_ = bus_.submit(batch, count);
    if (!in_flight_) {
        failed(now_us, I2cStatus::stuck);
    }
}

void RegisterGyro::send_writes(uint64_t now_us, GyroWrites writes) {
    I2cTransaction batch[GyroRegisters::max_writes];
    send(now_us, batch, compile(writes, batch));
}

void RegisterGyro::send_read(uint64_t now_us, uint8_t reg, uint8_t count) {
    I2cTransaction transaction = write_of(&reg, 1);
    transaction.read_length = count;
    send(now_us, &transaction, 1);
}

void RegisterGyro::send_identify(uint64_t now_us) {
    ++starts_;
    I2cTransaction batch[GyroRegisters::max_writes + 1];
    const size_t count = compile(chip_.before_identity, batch);
    batch[count] = write_of(&chip_.identity_reg, 1);
    batch[count].read_length = 1;
    send(now_us, batch, count + 1);
}

/// Each piece is sent with its address.
void RegisterGyro::send_piece(uint64_t now_us) {
    const size_t word = uploaded_ / 2;
    const uint8_t place[] = {chip_.upload_place_reg, static_cast<uint8_t>(word & 0xFu),
                             static_cast<uint8_t>(word >> 4)};
    uint8_t piece[upload_piece + 1] = {chip_.upload_reg};
    std::copy(configuration_ + uploaded_, configuration_ + uploaded_ + upload_piece, piece + 1);
    const I2cTransaction batch[] = {write_of(place, sizeof place), write_of(piece, sizeof piece)};
    send(now_us, batch, 2);
}

void RegisterGyro::send_step(uint64_t now_us) {
    const GyroStep &step = chip_.steps[step_];
    switch (step.kind) {
    case GyroStep::Kind::write:
        send_writes(now_us, step.writes);
        return;
    case GyroStep::Kind::upload:
        send_piece(now_us);
        return;
    case GyroStep::Kind::expect:
        send_read(now_us, step.reg, 1);
        return;
    }
}

void RegisterGyro::send_next(uint64_t now_us) {
    if (phase_ == Phase::identify) {
        send_identify(now_us);
        return;
    }
    if (phase_ == Phase::step) {
        send_step(now_us);
        return;
    }
    looking_ = suspicious_ || ++readings_since_readback_ >= look_interval;
    if (looking_) {
        send_read(now_us, chip_.checks[check_].reg, chip_.checks[check_].count);
    } else {
        send_read(now_us, chip_.data_reg, reading_bytes);
    }
}

} // namespace omni
