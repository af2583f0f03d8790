// SPDX-License-Identifier: MIT
/// @file pca9685.h  Driver of the PWM chip that feeds the H-bridges (NXP PCA9685 datasheet rev. 4).
///
/// Start: ALL_LED off first (the chip keeps driving through a reboot of ours), then sleep, prescaler, totem-pole outputs that
/// change together on STOP, wake, 500 us for the oscillator. After that one batch per tick: every channel in use, adjacent
/// channels joined to one auto-increment burst. ON and OFF counts are never equal: ends of the range use the full bits.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/board.h"
#include "app/core.h"
#include "omni/types.h"

namespace omni {

/// PWM channels of each wheel's bridge inputs.
struct Wiring {
    uint8_t wheels = 0; ///< 3 or 4
    uint8_t in1[OMNI_MAX_WHEELS] = {};
    uint8_t in2[OMNI_MAX_WHEELS] = {};
};

bool operator==(const Wiring &a, const Wiring &b);

class Pca9685 {
public:
    static constexpr uint8_t address = 0x40;
    static constexpr uint8_t channels = 16;

    Pca9685() = default;
    Pca9685(const Pca9685 &) = delete; // it points into itself
    Pca9685 &operator=(const Pca9685 &) = delete;

    /// Begin again with the power-up sequence.
    void restart();
    void set_wiring(const Wiring &wiring);
    /// Once per tick, before the control step: see how the last batch went.
    void poll(I2cBus &bus);
    /// Once per tick, after the control step: send the next batch. @param bridge one entry per wheel.
    void drive(I2cBus &bus, uint64_t now_us, const omni_bridge_counts_t *bridge);
    /// Switch all outputs off. @return false if the bus is busy: call again.
    bool all_off(I2cBus &bus);

    /// The power-up sequence is complete.
    bool ready() const { return phase_ == Phase::ready; }
    /// Updates in a row that did not reach the chip. One is due in each tick: a batch that turns out stuck after three was three.
    uint16_t failures() const { return failures_; }
    /// Failed batches since boot.
    uint32_t errors() const { return errors_; }

private:
    enum class Phase : uint8_t { off, configure, wake, settle, ready };

    void lay_out_update();
    uint8_t *place_of(uint8_t channel);
    void send(I2cBus &bus, const I2cTransaction *batch, size_t count);
    void send_setup(I2cBus &bus, uint64_t now_us);
    size_t fill_update(const omni_bridge_counts_t *bridge);
    void succeeded(const uint8_t *read);
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
    uint16_t since_health_ = 0; ///< updates since MODE1 was last read back
    uint32_t errors_ = 0;
    uint64_t awake_us_ = 0;
};

} // namespace omni
