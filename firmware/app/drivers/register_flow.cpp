// SPDX-License-Identifier: MIT
#include "app/drivers/register_flow.h"

#include <algorithm>
#include <cmath>

#include "app/base/core.h"

namespace omni {
namespace {

constexpr uint64_t retry_us = 200'000;
/// Timeout beyond the documented duration of the calibration.
constexpr uint64_t patience_us = 1'000'000;
/// Maximum age of a transfer: an older one was sent before a pause by hardware-in-the-loop.
constexpr uint64_t stale_us = 10'000;
/// Timeout of a transfer in ticks. The longest, a Pinpoint's pose, is 0.75 ms at 400 kHz.
constexpr uint8_t busy_limit = 5;
constexpr uint8_t failures_allowed = 10;
constexpr uint8_t good_enough = 10;
constexpr float farthest_m = 8.0f;
/// Plausibility limit of the speed: 100 wheel revolutions per second.
constexpr float fastest_m_s = 10.0f;

constexpr uint8_t way_only = static_cast<uint8_t>(OMNI_FLOW_XY) | static_cast<uint8_t>(OMNI_FLOW_RECEIVED);
constexpr uint8_t whole = way_only | static_cast<uint8_t>(OMNI_FLOW_TURN);

/// Is the pose finite and plausible?
bool is_number(const CountedPose &pose) {
    return std::fabs(pose.x_m) < 1e6f && std::fabs(pose.y_m) < 1e6f && std::fabs(pose.heading_rad) < 1e6f;
}

} // namespace

FlowTrouble RegisterFlow::trouble() const {
    const uint16_t packed = trouble_.load(std::memory_order_relaxed);
    return {static_cast<FlowCause>(packed & 0xFFu), static_cast<uint8_t>(packed >> 8), chip_.identities[0]};
}

void RegisterFlow::set_trouble(FlowCause cause, uint8_t seen) {
    trouble_.store(static_cast<uint16_t>(static_cast<uint16_t>(cause) | seen << 8), std::memory_order_relaxed);
}

void RegisterFlow::restart_chip(uint64_t now_us, FlowCause cause, uint8_t seen) {
    set_trouble(cause, seen);
    phase_ = Phase::identify;
    have_pose_ = false;
    good_ = 0;
    failures_ = 0;
    due_us_ = now_us + retry_us;
}

/// When disabled, the batch in flight is completed, and no other is sent.
void RegisterFlow::apply_enable() {
    const bool wanted = wanted_.load(std::memory_order_relaxed);
    if (wanted == used_) {
        return;
    }
    used_ = wanted;
    phase_ = Phase::identify;
    have_pose_ = false;
    good_ = 0;
    due_us_ = 0;
    set_trouble(FlowCause::none);
}

uint8_t RegisterFlow::read(uint64_t now_us, float *moved, bool rests) {
    rests_ = rests;
    rested_ = rested_ && rests;
    apply_enable();
    const uint8_t fresh = in_flight_ ? process_batch(now_us, moved) : uint8_t{0};
    if (used_ && !in_flight_ && now_us >= due_us_) {
        send_next(now_us);
    }
    return fresh;
}

uint8_t RegisterFlow::process_batch(uint64_t now_us, float *moved) {
    uint8_t bytes[I2cTransaction::max_read] = {};
    const I2cStatus status = bus_.poll(bytes);
    if (status == I2cStatus::busy && ++busy_ticks_ < busy_limit) {
        return 0;
    }
    in_flight_ = false;
    busy_ticks_ = 0;
    if (!used_) {
        return 0;
    }
    if (status == I2cStatus::done) {
        return arrived(now_us, bytes, moved);
    }
    failed(now_us, status);
    return 0;
}

void RegisterFlow::failed(uint64_t now_us, I2cStatus status) {
    if (status != I2cStatus::nack) {
        bus_.recover();
    }
    const bool running = phase_ == Phase::run || phase_ == Phase::zero;
    if (!running || ++failures_ >= failures_allowed) {
        calibrated_ = false; // it may have lost its power
        restart_chip(now_us, status == I2cStatus::nack ? FlowCause::absent : FlowCause::bus);
        return;
    }
    phase_ = Phase::run;
}

uint8_t RegisterFlow::arrived(uint64_t now_us, const uint8_t *bytes, float *moved) {
    failures_ = 0;
    if (phase_ == Phase::identify) {
        identified(now_us, bytes[0]);
    } else if (phase_ != Phase::run) {
        next_write_ += 1 + *next_write_;
        if (*next_write_ == 0) {
            writes_done(now_us);
        }
    } else if (now_us - sent_us_ < stale_us) {
        return process_pose(now_us, chip_.decode(bytes), moved);
    }
    return 0;
}

/// Discard the last pose: the next one starts a new interval.
void RegisterFlow::begin(Phase phase, I2cWrites writes) {
    phase_ = phase;
    next_write_ = writes;
    have_pose_ = false;
    rested_ = rested_ || phase == Phase::calibrate;
}

void RegisterFlow::writes_done(uint64_t now_us) {
    if (phase_ == Phase::calibrate) {
        begin(Phase::start, chip_.start);
        due_us_ = now_us + chip_.calibrate_us;
        ready_by_us_ = due_us_ + patience_us;
        calibration_disturbed_ = true;
    } else if (phase_ == Phase::start) {
        calibrated_ = calibrated_ || rested_;
        calibration_disturbed_ = calibration_disturbed_ && !rested_;
        begin(Phase::zero, chip_.zero);
        due_us_ = now_us + chip_.start_us;
    } else {
        phase_ = Phase::run;
        due_us_ = now_us + chip_.zero_us;
    }
}

void RegisterFlow::identified(uint64_t now_us, uint8_t seen) {
    if (seen != chip_.identities[0] && seen != chip_.identities[1]) {
        restart_chip(now_us, FlowCause::wrong_id, seen);
        return;
    }
    rested_ = false;
    if (calibration_possible()) {
        begin(Phase::calibrate, chip_.calibrate);
    } else {
        begin(Phase::start, chip_.start);
    }
}

/// A pose with an error status is not used, but it starts the next interval.
uint8_t RegisterFlow::process_pose(uint64_t now_us, const CountedPose &pose, float *moved) {
    if (!pose.ready && now_us < ready_by_us_) {
        return 0;
    }
    if (!pose.ready) {
        calibrated_ = false;
        restart_chip(now_us, FlowCause::restarted); // and has lost its settings
        return 0;
    }
    if (!is_number(pose)) {
        restart_chip(now_us, FlowCause::jumped);
        return 0;
    }
    uint8_t fresh = OMNI_FLOW_RECEIVED;
    if (pose.cause != FlowCause::none) {
        good_ = 0;
        set_trouble(pose.cause, pose.status);
    } else if (have_pose_) {
        fresh = compute_displacement(now_us, pose, moved);
    }
    if (fresh != 0) {
        last_ = pose;
        last_us_ = sent_us_;
        have_pose_ = phase_ == Phase::run; // false while it is being reset to zero
    }
    return fresh;
}

/// @return 0 after an implausible jump, which restarts the chip.
uint8_t RegisterFlow::compute_displacement(uint64_t now_us, const CountedPose &pose, float *moved) {
    const float x = pose.x_m - last_.x_m;
    const float y = pose.y_m - last_.y_m;
    const float most = fastest_m_s * static_cast<float>(sent_us_ - last_us_) * 1e-6f;
    if (std::fabs(x) + std::fabs(y) > most) {
        calibrated_ = false; // it may have lost its power
        restart_chip(now_us, FlowCause::jumped);
        return 0;
    }
    const float turn = omni_wrap_pi(pose.heading_rad - last_.heading_rad);
    float sine = 0.0f;
    float cosine = 1.0f;
    omni_sincosf(omni_wrap_pi(last_.heading_rad + 0.5f * turn), &sine, &cosine);
    moved[0] = cosine * x + sine * y;
    moved[1] = cosine * y - sine * x;
    moved[2] = turn;
    good_ = good_ < good_enough ? static_cast<uint8_t>(good_ + 1) : good_;
    if (good_ == good_enough) {
        set_trouble(FlowCause::none);
    }
    if (std::max(std::fabs(pose.x_m), std::fabs(pose.y_m)) > farthest_m) {
        begin(Phase::zero, chip_.zero);
        due_us_ = now_us;
    }
    return calibration_disturbed_ ? way_only : whole;
}

void RegisterFlow::send(uint64_t now_us, const I2cTransaction &transaction) {
    sent_us_ = now_us;
    in_flight_ = bus_.submit(&transaction, 1);
    if (!in_flight_) {
        failed(now_us, I2cStatus::stuck);
    }
}

void RegisterFlow::send_write(uint64_t now_us) {
    send(now_us, i2c_write_of(address_, next_write_ + 1, *next_write_));
}

void RegisterFlow::send_read(uint64_t now_us, uint8_t reg, uint8_t count) {
    I2cTransaction transaction = i2c_write_of(address_, &reg, 1);
    transaction.read_length = count;
    send(now_us, transaction);
}

void RegisterFlow::send_next(uint64_t now_us) {
    if (phase_ == Phase::identify) {
        ++starts_;
        send_read(now_us, chip_.identity_reg, 1);
    } else if (phase_ == Phase::run && calibration_possible()) {
        begin(Phase::calibrate, chip_.calibrate);
        send_write(now_us);
    } else if (phase_ == Phase::run) {
        due_us_ = now_us + period_us;
        send_read(now_us, chip_.data_reg, chip_.data_count);
    } else {
        send_write(now_us);
    }
}

} // namespace omni
