// SPDX-License-Identifier: MIT
/// @file register_gyro.h  Driver of a gyro chip on a dedicated I2C bus. The chip is described by data
/// (gyro_registers.h).
///
/// Start: identity, the chip's steps, read-back of the settings. A configuration file is uploaded in pieces of 32
/// bytes, one per tick. Then one read of six bytes per tick. Settings are read back at 20 Hz in place of a reading, and
/// at once after a reading that indicates "no data". Any fault restarts the sequence 200 ms later.
///
/// It must not share the PWM chip's bus, which needs an update in each tick: a gyro that holds SDA low must not stop
/// the motors.
///
/// The chips' data have no checksum. A reading that differs from the last one by more than 4 rad/s is rejected unless
/// the next one confirms it. This rejects bit errors in the upper four bits, not in the lower twelve.
///
/// Latency: up to one sample period of the chip at the read, plus one tick.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "app/base/board.h"
#include "app/base/gyro_chip.h"
#include "app/drivers/gyro_registers.h"

namespace omni {

class RegisterGyro final : public GyroChip {
public:
    static constexpr size_t upload_piece = 32;

    /// @param bus dedicated to the gyro. @param address 7 bit. @param configuration file for chips that need one; its
    /// length is a multiple of upload_piece.
    RegisterGyro(I2cBus &bus, uint8_t address, const GyroRegisters &registers, const uint8_t *configuration = nullptr,
                 size_t configuration_size = 0)
        : bus_(bus), address_(address), chip_(registers), configuration_(configuration),
          configuration_size_(configuration_size),
          jump_steps_(static_cast<int>(jump_rad_s / registers.rad_s_per_step)) {}

    void use_axis(int8_t axis) override { requested_axis_.store(axis, std::memory_order_relaxed); }
    uint8_t read(uint64_t now_us, float *rad_s) override;
    GyroTrouble trouble() const override;
    /// Number of starts since boot, including failed attempts.
    uint32_t starts() const { return starts_; }

private:
    /// Purpose of the batch in flight, or the next one.
    enum class Phase : uint8_t { identify, step, run };
    static constexpr size_t axes = 3;
    static constexpr float jump_rad_s = 4.0f; ///< in a millisecond: 4000 rad/s^2

    void apply_axis();
    uint8_t process_batch(uint64_t now_us, float *rad_s);
    uint8_t arrived(uint64_t now_us, const uint8_t *bytes, float *rad_s);
    void identified(uint64_t now_us, uint8_t seen);
    void step_done(uint64_t now_us, const uint8_t *bytes);
    void next_step(uint64_t now_us, uint32_t wait_us);
    void failed(uint64_t now_us, I2cStatus status);
    void send_next(uint64_t now_us);
    void send(uint64_t now_us, const I2cTransaction *batch, size_t count);
    void send_identify(uint64_t now_us);
    void send_step(uint64_t now_us);
    void send_piece(uint64_t now_us);
    void send_writes(uint64_t now_us, GyroWrites writes);
    void send_read(uint64_t now_us, uint8_t reg, uint8_t count);
    size_t compile(GyroWrites writes, I2cTransaction *batch) const;
    I2cTransaction write_of(const uint8_t *bytes, size_t count) const;
    void begin_run();
    void check_readback(uint64_t now_us, const uint8_t *bytes);
    uint8_t process_reading(uint64_t now_us, const uint8_t *bytes, float *rad_s);
    int16_t value_of(const uint8_t *bytes) const;
    bool is_jump(int16_t from, int16_t to) const;
    bool stands_still(const int16_t *raw);
    bool jumps(int16_t raw);
    void count_jump(bool jumped);
    void judge(int16_t raw);
    void restart_chip(uint64_t now_us, GyroCause cause, uint8_t seen = 0);
    void set_trouble(GyroCause cause, uint8_t seen = 0);

    I2cBus &bus_;
    const uint8_t address_;
    const GyroRegisters &chip_;
    const uint8_t *const configuration_;
    const size_t configuration_size_;
    const int jump_steps_;
    std::atomic<int8_t> requested_axis_{0};
    std::atomic<uint16_t> trouble_{0}; ///< cause and `seen`
    int8_t axis_ = 0;                  ///< `requested_axis_` as applied by the tick
    Phase phase_ = Phase::identify;
    uint8_t step_ = 0;     ///< of the initialisation
    uint8_t attempts_ = 0; ///< of an expect step
    size_t uploaded_ = 0;  ///< bytes of the configuration file
    bool in_flight_ = false;
    bool looking_ = false;        ///< the batch in flight reads the settings back
    bool suspicious_ = false;     ///< read back the settings next
    bool readback_error_ = false; ///< the last read-back was wrong
    bool have_used_ = false;      ///< used_ is valid
    bool last_rejected_ = false;  ///< the last reading was rejected as a jump
    bool noisy_ = false;          ///< too many jumps in the last window
    uint8_t check_ = 0;           ///< index of the next read-back
    uint8_t busy_ticks_ = 0;
    uint8_t failures_ = 0;                 ///< consecutive failed transfers
    uint8_t invalid_ = 0;                  ///< consecutive "no data" readings
    uint8_t same_ = 0;                     ///< consecutive readings equal in all axes
    uint8_t good_ = 0;                     ///< consecutive readings used
    uint16_t readings_since_readback_ = 0; ///< readings since the settings were read back
    uint16_t window_ = 0;                  ///< readings since the jumps were last counted
    uint16_t jumps_ = 0;                   ///< jumps in the current window
    int16_t last_[axes] = {};              ///< newest reading, raw
    int16_t used_ = 0;                     ///< newest reading of axis_ that was used, raw
    uint32_t starts_ = 0;
    uint64_t sent_us_ = 0; ///< start of the batch in flight
    uint64_t due_us_ = 0;  ///< earliest time of the next transfer
};

} // namespace omni
