// SPDX-License-Identifier: MIT
/// @file pca9685.h  Driver of the PWM chip that feeds the H-bridges (NXP PCA9685 datasheet rev. 4).
///
/// Start: ALL_LED off first, because the chip keeps driving through a reboot of ours. Then sleep, prescaler, totem-pole
/// outputs that change together on STOP, wake, 500 us for the oscillator. After that one batch per tick: every channel
/// in use, adjacent channels joined to one auto-increment burst. ON and OFF counts are never equal: ends of the range
/// use the full bits.
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
    Pca9685(const Pca9685 &) = delete; // it points into itself
    Pca9685 &operator=(const Pca9685 &) = delete;

    /// Begin again with the power-up sequence.
    void restart() override;
    void set_wiring(const Wiring &wiring) override;
    void poll(MotorWires &wires) override;
    void drive(MotorWires &wires, uint64_t now_us, const omni_real_t *duty, bool on) override;
    bool all_off(MotorWires &wires) override;
    /// The same for a bus on which no driver works: ALL_LED_OFF. @return false if the bus is busy.
    static bool submit_all_off(I2cBus &bus);
    /// The power-up sequence is complete.
    bool ready() const override { return phase_ == Phase::ready; }
    uint16_t failures() const override { return failures_; }
    bool read_back_missing() const override { return failures_at_best_ != 0; }
    uint32_t errors() const override { return errors_; }

private:
    /// So often MODE1 may read wrong, each time after a complete set-up: a chip that lost its power does so once.
    static constexpr uint16_t wrong_looks_allowed = 3;

    enum class Phase : uint8_t { off, configure, wake, settle, ready };

    void lay_out_update();
    uint8_t *place_of(uint8_t channel);
    void send(I2cBus &bus, const I2cTransaction *batch, size_t count);
    void send_setup(I2cBus &bus, uint64_t now_us);
    size_t fill_update(const omni_real_t *duty, bool on);
    void succeeded(const uint8_t *read);
    void looked_wrong();
    void failed(I2cBus &bus, bool stuck, uint32_t updates);

    Wiring wiring_;
    I2cTransaction update_[channels / 2 + 1]; ///< bursts of adjacent channels; after them the look at MODE1
    size_t bursts_ = 0;
    uint8_t *in1_[OMNI_MAX_WHEELS] = {}; ///< where a wheel's bytes are in the update
    uint8_t *in2_[OMNI_MAX_WHEELS] = {};
    Phase phase_ = Phase::off;
    bool in_flight_ = false;
    bool health_asked_ = false; ///< the batch in flight reads MODE1 back
    bool suspicious_ = false;   ///< a batch failed since MODE1 was last read back
    uint32_t busy_ticks_ = 0;
    uint16_t failures_ = 0;
    uint16_t since_health_ = 0;     ///< updates since MODE1 was last read back
    uint16_t wrong_looks_ = 0;      ///< looks at MODE1 in a row that read something else
    uint16_t failures_at_best_ = 0; ///< after an update that arrived: UINT16_MAX while nothing can be read back
    uint32_t errors_ = 0;
    uint64_t awake_us_ = 0;
};

} // namespace omni
