// SPDX-License-Identifier: MIT
/// @file pwm_pins.h  Base class of motor drivers on the processor's PWM pins. Without chip and bus, the duties of a
/// tick are output before it ends.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/drivers/motor_driver.h"

namespace omni {

class PwmPins : public MotorDriver {
public:
    PwmPins(const PwmPins &) = delete;
    PwmPins &operator=(const PwmPins &) = delete;

    void restart() override;
    void set_wiring(const Wiring &wiring) override { wheels_ = wiring.wheels; }
    void poll(MotorWires &) override {}
    void drive(MotorWires &wires, uint64_t now_us, const omni_real_t *duty, bool on) override;
    bool all_off(MotorWires &wires) override;
    /// The pins have accepted an update. Always false on a board with another wiring.
    bool ready() const override { return ready_; }
    uint16_t failures() const override { return failures_; }
    uint32_t errors() const override { return errors_; }

protected:
    /// @param driver omni_mot_driver.
    explicit PwmPins(uint8_t driver) : driver_(driver) {}
    ~PwmPins() = default;
    /// Convert IN1/IN2 counts to this driver's two pins.
    virtual MotorPinSteps steps_of(const omni_bridge_counts_t &bridge) const = 0;

private:
    bool wired(const MotorWires &wires) const { return wires.pins != nullptr && wires.pins->serves_driver(driver_); }

    const uint8_t driver_;
    uint8_t wheels_ = 0;
    bool ready_ = false;
    uint16_t failures_ = 0;
    uint32_t errors_ = 0;
};

} // namespace omni
