// SPDX-License-Identifier: MIT
/// @file register_gyro.h  Driver of a gyro's chip on an I2C bus of its own; what is special to a chip is data
/// (gyro_registers.h).
///
/// Start: identity, then the chip's steps, then its settings are read back. A chip with a configuration file gets it in
/// pieces of 32 bytes, one per tick. After the start there is one read of six bytes per tick. Settings are read back 20
/// times a second in place of a reading. Where the readings look as if the chip does not measure, they are read back at
/// once. What goes wrong begins the start anew, 200 ms later.
///
/// Its bus must not be the PWM chip's. That one's updates are due in each tick, and a gyro that holds SDA low must not
/// stop the motors.
///
/// The chips' replies have no checksum. A reading that differs from the last one by more than 4 rad/s is left out,
/// unless the next one agrees with it. So a wrong bit of the upper four does not get through. One of the lower twelve
/// does.
///
/// A reading is up to one of the chip's periods old when the tick asks, and used in the next tick.
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

    /// @param bus the gyro's alone. @param address 7 bit. @param configuration of a chip whose steps upload one;
    /// a multiple of upload_piece long.
    RegisterGyro(I2cBus &bus, uint8_t address, const GyroRegisters &registers, const uint8_t *configuration = nullptr,
                 size_t configuration_size = 0)
        : bus_(bus), address_(address), chip_(registers), configuration_(configuration),
          configuration_size_(configuration_size),
          jump_steps_(static_cast<int>(jump_rad_s / registers.rad_s_per_step)) {}

    void use_axis(int8_t axis) override { wanted_axis_.store(axis, std::memory_order_relaxed); }
    uint8_t read(uint64_t now_us, float *rad_s) override;
    GyroTrouble trouble() const override;
    /// Starts since boot, the first one included: attempts without an answer count, too.
    uint32_t starts() const { return starts_; }

private:
    /// What the batch in flight, or the next one, is for.
    enum class Phase : uint8_t { identify, step, run };
    static constexpr size_t axes = 3;
    static constexpr float jump_rad_s = 4.0f; ///< in a millisecond: 4000 rad/s^2

    void follow_axis();
    uint8_t take_batch(uint64_t now_us, float *rad_s);
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
    void check_look(uint64_t now_us, const uint8_t *bytes);
    uint8_t take_reading(uint64_t now_us, const uint8_t *bytes, float *rad_s);
    int16_t value_of(const uint8_t *bytes) const;
    bool is_jump(int16_t from, int16_t to) const;
    bool stands_still(const int16_t *raw);
    bool jumps(int16_t raw);
    void count_jump(bool jumped);
    void judge(int16_t raw);
    void start_again(uint64_t now_us, GyroCause cause, uint8_t seen = 0);
    void show(GyroCause cause, uint8_t seen = 0);

    I2cBus &bus_;
    const uint8_t address_;
    const GyroRegisters &chip_;
    const uint8_t *const configuration_;
    const size_t configuration_size_;
    const int jump_steps_;
    std::atomic<int8_t> wanted_axis_{0};
    std::atomic<uint16_t> trouble_{0}; ///< cause and `seen`
    int8_t axis_ = 0;                  ///< that the tick works with
    Phase phase_ = Phase::identify;
    uint8_t step_ = 0;     ///< of the start
    uint8_t attempts_ = 0; ///< of a step that expects something
    size_t uploaded_ = 0;  ///< bytes of the configuration file
    bool in_flight_ = false;
    bool looking_ = false;    ///< the batch in flight reads the settings back
    bool suspicious_ = false; ///< read them back next
    bool wrong_look_ = false; ///< one of these looks found something else
    bool have_used_ = false;  ///< used_ is a reading
    bool left_out_ = false;   ///< the reading before was left out: it had jumped
    bool noisy_ = false;      ///< too many of them jumped in the last window
    uint8_t look_ = 0;        ///< the next one
    uint8_t busy_ticks_ = 0;
    uint8_t failures_ = 0;    ///< transfers in a row that did not arrive
    uint8_t invalid_ = 0;     ///< readings in a row that the chip calls none
    uint8_t same_ = 0;        ///< readings in a row that are equal in all axes
    uint8_t good_ = 0;        ///< readings in a row that were used
    uint16_t since_look_ = 0; ///< readings since the settings were read back
    uint16_t window_ = 0;     ///< readings since the jumps were last counted
    uint16_t jumps_ = 0;      ///< of them
    int16_t last_[axes] = {}; ///< the newest reading, as the chip gives it
    int16_t used_ = 0;        ///< the newest one of axis_ that was used
    uint32_t starts_ = 0;
    uint64_t sent_us_ = 0; ///< the batch in flight
    uint64_t due_us_ = 0;  ///< nothing is sent before
};

} // namespace omni
