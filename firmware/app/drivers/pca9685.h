// SPDX-License-Identifier: MIT
/// @file pca9685.h  Motor driver with the PWM chip PCA9685 and H-bridges (NXP datasheet rev. 4).
///
/// Initialisation: ALL_LED off first, because the chip keeps driving while the processor reboots. Then sleep,
/// prescaler, totem-pole outputs updated on STOP, wake, 500 us for the oscillator. After that one batch per tick: all
/// channels in use, adjacent channels joined to one auto-increment burst. ON and OFF counts are never equal: duties 0
/// and 1 use the full-on and full-off bits.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"
#include "app/base/core.h"
#include "app/drivers/motor_driver.h"
#include "omni/types.h"

namespace omni {

class Pca9685 final : public MotorDriver {
public:
    static constexpr uint8_t address = 0x40;
    static constexpr uint8_t channels = 16;

    Pca9685() = default;
    Pca9685(const Pca9685 &) = delete; // it holds pointers to its own members
    Pca9685 &operator=(const Pca9685 &) = delete;

    /// Restart with the power-up sequence.
    void restart() override;
    void set_wiring(const Wiring &wiring) override;
    void poll(MotorWires &wires) override;
    void drive(MotorWires &wires, uint64_t now_us, const omni_real_t *duty, bool on) override;
    bool all_off(MotorWires &wires) override;
    /// Submit ALL_LED_OFF to a bus that has no driver in use. @return false if the bus is busy.
    static bool submit_all_off(I2cBus &bus);
    /// The power-up sequence is complete.
    bool ready() const override { return phase_ == Phase::ready; }
    uint16_t failures() const override { return failures_; }
    bool read_back_missing() const override { return min_failures_ != 0; }
    uint32_t errors() const override { return errors_; }

private:
    /// Consecutive wrong read-backs of MODE1, each after a complete initialisation, that are tolerated: a chip that
    /// lost its power needs one.
    static constexpr uint16_t max_readback_errors = 3;

    enum class Phase : uint8_t { off, configure, wake, settle, ready };

    void build_update_layout();
    uint8_t *channel_slot(uint8_t channel);
    void send(I2cBus &bus, const I2cTransaction *batch, size_t count);
    void send_setup(I2cBus &bus, uint64_t now_us);
    size_t fill_update(const omni_real_t *duty, bool on);
    void succeeded(const uint8_t *read);
    void readback_failed();
    void failed(I2cBus &bus, bool stuck, uint32_t updates);

    Wiring wiring_;
    I2cTransaction update_[channels / 2 + 1]; ///< bursts of adjacent channels, then the read-back of MODE1
    size_t bursts_ = 0;
    uint8_t *in1_[OMNI_MAX_WHEELS] = {}; ///< a wheel's bytes in the update
    uint8_t *in2_[OMNI_MAX_WHEELS] = {};
    Phase phase_ = Phase::off;
    bool in_flight_ = false;
    bool readback_in_flight_ = false; ///< the batch in flight reads MODE1 back
    bool suspicious_ = false;         ///< a batch failed since MODE1 was last read back
    uint32_t busy_ticks_ = 0;
    uint16_t failures_ = 0;
    uint16_t updates_since_readback_ = 0; ///< updates since MODE1 was last read back
    uint16_t readback_errors_ = 0;        ///< consecutive wrong read-backs of MODE1
    uint16_t min_failures_ = 0;           ///< lower bound of failures(): UINT16_MAX while reading back never succeeds
    uint32_t errors_ = 0;
    uint64_t awake_us_ = 0;
};

} // namespace omni
