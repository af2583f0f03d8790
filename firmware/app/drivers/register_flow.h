// SPDX-License-Identifier: MIT
/// @file register_flow.h  Driver of a floor odometry chip that integrates its own pose, on a dedicated I2C bus. The
/// chip is described by data (pose_counter.h).
///
/// Start: identity, gyro calibration, settings, zero pose, one write per tick, each with its own STOP (the chips are
/// microcontrollers). Then one read every 20 ms. The difference of two poses is rotated to the sensor's axes at
/// mid-interval:
///
///   moved_xy = R(-(h0 + h1) / 2) (p1 - p0),   turn = h1 - h0 within half a turn
///
/// A pose with an error status is not used, and that interval is lost. A failed read loses nothing: the next difference
/// spans both intervals. Beyond 8 m the chip's pose is reset to zero, because an OTOS overflows at 10 m; one reading is
/// discarded then, as the time of the reset is unknown. Any fault restarts the sequence 200 ms later.
///
/// The gyro is calibrated once at rest. It is repeated at the next rest if the robot moved meanwhile, or after the chip
/// did not respond (power loss). Turns after a disturbed calibration are not used.
///
/// It must not share the PWM chip's bus: a sensor that holds SDA low must not stop the motors.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "app/base/board.h"
#include "app/base/flow_chip.h"
#include "app/drivers/pose_counter.h"

namespace omni {

class RegisterFlow final : public FlowChip {
public:
    static constexpr uint64_t period_us = 20'000; ///< between two readings

    /// @param bus dedicated to the sensor. @param address 7 bit.
    RegisterFlow(I2cBus &bus, uint8_t address, const PoseCounter &chip) : bus_(bus), address_(address), chip_(chip) {}

    void use(bool wanted) override { wanted_.store(wanted, std::memory_order_relaxed); }
    uint8_t read(uint64_t now_us, float *moved, bool rests) override;
    FlowTrouble trouble() const override;
    /// Number of starts since boot, including failed attempts.
    uint32_t starts() const { return starts_; }

private:
    /// Purpose of the batch in flight, or the next one.
    enum class Phase : uint8_t { identify, calibrate, start, run, zero };

    void apply_enable();
    uint8_t process_batch(uint64_t now_us, float *moved);
    uint8_t arrived(uint64_t now_us, const uint8_t *bytes, float *moved);
    void identified(uint64_t now_us, uint8_t seen);
    uint8_t process_pose(uint64_t now_us, const CountedPose &pose, float *moved);
    uint8_t compute_displacement(uint64_t now_us, const CountedPose &pose, float *moved);
    void failed(uint64_t now_us, I2cStatus status);
    void send_next(uint64_t now_us);
    void send_read(uint64_t now_us, uint8_t reg, uint8_t count);
    void send_write(uint64_t now_us);
    void send(uint64_t now_us, const I2cTransaction &transaction);
    bool calibration_possible() const { return chip_.calibrate != nullptr && !calibrated_ && rests_; }
    void begin(Phase phase, I2cWrites writes);
    void writes_done(uint64_t now_us);
    void restart_chip(uint64_t now_us, FlowCause cause, uint8_t seen = 0);
    void set_trouble(FlowCause cause, uint8_t seen = 0);

    I2cBus &bus_;
    const uint8_t address_;
    const PoseCounter &chip_;
    std::atomic<bool> wanted_{false};
    std::atomic<uint16_t> trouble_{0}; ///< cause and `seen`
    bool used_ = false;                ///< `wanted_` as applied by the tick
    Phase phase_ = Phase::identify;
    I2cWrites next_write_ = nullptr;     ///< in the phase's list
    bool rests_ = false;                 ///< the robot is at rest
    bool rested_ = false;                ///< at rest since the start of the calibration
    bool calibrated_ = false;            ///< the calibration has succeeded
    bool calibration_disturbed_ = false; ///< the robot moved during the last calibration
    uint64_t ready_by_us_ = 0;           ///< until then a calibrated chip may still be initialising
    bool in_flight_ = false;
    bool have_pose_ = false; ///< last_ is valid
    uint8_t busy_ticks_ = 0;
    uint8_t failures_ = 0; ///< consecutive failed transfers
    uint8_t good_ = 0;     ///< consecutive readings used
    CountedPose last_;
    uint64_t last_us_ = 0; ///< time of last_
    uint64_t sent_us_ = 0; ///< start of the batch in flight
    uint64_t due_us_ = 0;  ///< earliest time of the next transfer
    uint32_t starts_ = 0;
};

} // namespace omni
