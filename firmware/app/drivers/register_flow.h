// SPDX-License-Identifier: MIT
/// @file register_flow.h  Driver of a chip that counts its own pose over the floor, on an I2C bus of its own. What is
/// special to a chip is data (pose_counter.h).
///
/// Start: identity, the calibration of its gyro, its settings, a pose of zero, a write per tick. Such chips are small
/// computers: each write ends with a STOP of its own. After that there is one read every 20 ms. The difference of two
/// poses is turned into the sensor's axes of mid-way:
///
///   moved_xy = R(-(h0 + h1) / 2) (p1 - p0),   turn = h1 - h0 within half a turn
///
/// A pose that the chip does not trust is not used, and what it measured meanwhile is lost. A read that fails loses
/// nothing: the next difference spans both. Beyond 8 m from its zero the chip's pose is set to zero, because an OTOS
/// counts to 10 m. One reading is lost then, because nobody knows when that takes effect. What goes wrong begins the
/// start anew, 200 ms later.
///
/// The gyro is calibrated while the robot stands, once. It is done again at the next rest if the robot moves meanwhile.
/// So it is after the chip was away, without power perhaps. After a calibration on the move its turns are not used.
///
/// Its bus must not be the PWM chip's: a sensor that holds SDA low must not stop the motors.
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

    /// @param bus the sensor's alone. @param address 7 bit.
    RegisterFlow(I2cBus &bus, uint8_t address, const PoseCounter &chip) : bus_(bus), address_(address), chip_(chip) {}

    void use(bool wanted) override { wanted_.store(wanted, std::memory_order_relaxed); }
    uint8_t read(uint64_t now_us, float *moved, bool rests) override;
    FlowTrouble trouble() const override;
    /// Starts since boot, the first one included: attempts without an answer count, too.
    uint32_t starts() const { return starts_; }

private:
    /// What the batch in flight, or the next one, is for.
    enum class Phase : uint8_t { identify, calibrate, start, run, zero };

    void follow_wish();
    uint8_t take_batch(uint64_t now_us, float *moved);
    uint8_t arrived(uint64_t now_us, const uint8_t *bytes, float *moved);
    void identified(uint64_t now_us, uint8_t seen);
    uint8_t take_pose(uint64_t now_us, const CountedPose &pose, float *moved);
    uint8_t take_move(uint64_t now_us, const CountedPose &pose, float *moved);
    void failed(uint64_t now_us, I2cStatus status);
    void send_next(uint64_t now_us);
    void send_read(uint64_t now_us, uint8_t reg, uint8_t count);
    void send_write(uint64_t now_us);
    void send(uint64_t now_us, const I2cTransaction &transaction);
    bool can_calibrate() const { return chip_.calibrate != nullptr && !calibrated_ && rests_; }
    void begin(Phase phase, I2cWrites writes);
    void writes_done(uint64_t now_us);
    void start_again(uint64_t now_us, FlowCause cause, uint8_t seen = 0);
    void show(FlowCause cause, uint8_t seen = 0);

    I2cBus &bus_;
    const uint8_t address_;
    const PoseCounter &chip_;
    std::atomic<bool> wanted_{false};
    std::atomic<uint16_t> trouble_{0}; ///< cause and `seen`
    bool used_ = false;                ///< what the tick works with
    Phase phase_ = Phase::identify;
    I2cWrites next_write_ = nullptr; ///< of the phase's list
    bool rests_ = false;             ///< the robot stands
    bool rested_ = false;            ///< it has stood since the calibration began
    bool calibrated_ = false;        ///< once is enough
    bool spoilt_ = false;            ///< the robot moved during the last calibration
    uint64_t ready_by_us_ = 0;       ///< until then a chip that has been calibrated may still be getting ready
    bool in_flight_ = false;
    bool have_pose_ = false; ///< last_ is the pose that the next one is compared with
    uint8_t busy_ticks_ = 0;
    uint8_t failures_ = 0; ///< transfers in a row that did not arrive
    uint8_t good_ = 0;     ///< readings in a row that were used
    CountedPose last_;
    uint64_t last_us_ = 0; ///< when last_ was asked for
    uint64_t sent_us_ = 0; ///< the batch in flight
    uint64_t due_us_ = 0;  ///< nothing is sent before
    uint32_t starts_ = 0;
};

} // namespace omni
