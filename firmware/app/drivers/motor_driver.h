// SPDX-License-Identifier: MIT
/// @file motor_driver.h  Motor driver interface: outputs a duty per wheel, with one class per kind of hardware.
///
/// A driver converts duties to signals, reports failed updates, and switches all motors off. ControlLoop implements the
/// rules common to all drivers: output enable, and the number of failures that stops the robot.
///
/// Called from the tick only; never blocks.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"
#include "app/base/core.h"

namespace omni {

/// Hardware interfaces to the motors: the board's, or simulated ones in hardware-in-the-loop.
struct MotorWires {
    I2cBus &bus;
    OutputEnable &enable;
    MotorPins *pins; ///< nullptr: none
};

/// Motor wiring by parameters.
struct Wiring {
    uint8_t wheels = 0;                ///< 3 or 4
    uint8_t in1[OMNI_MAX_WHEELS] = {}; ///< PWM channels of each wheel's bridge inputs (PCA9685)
    uint8_t in2[OMNI_MAX_WHEELS] = {};
    uint8_t driver = OMNI_MOT_DRIVER_PCA9685; ///< omni_mot_driver
};

bool operator==(const Wiring &a, const Wiring &b);

class MotorDriver {
public:
    /// Restart from an unknown hardware state: it may be unpowered or driving.
    virtual void restart() = 0;
    /// Set the wiring before the first tick, and between two ticks after parameter changes. No effect if unchanged.
    virtual void set_wiring(const Wiring &wiring) = 0;
    /// Once per tick, before the control step: get the result of the last update.
    virtual void poll(MotorWires &wires) = 0;
    /// Once per tick, after the control step: send the duties, or the next step of the initialisation.
    /// @param duty one entry per wheel, -1..1. @param on false: all motors coast, or brake where the bridge cannot
    /// coast.
    virtual void drive(MotorWires &wires, uint64_t now_us, const omni_real_t *duty, bool on) = 0;
    /// Switch all motors off, in any state; the hardware is initialised again afterwards.
    /// @return false if it could not be sent now: call again.
    virtual bool all_off(MotorWires &wires) = 0;

    /// The hardware is initialised and responds. Required for arming.
    virtual bool ready() const = 0;
    /// Consecutive failed updates, one per tick: an update found lost after three ticks counts as three.
    virtual uint16_t failures() const = 0;
    /// The hardware acknowledges writes, but reading back never succeeds: its state is unknown.
    virtual bool read_back_missing() const { return false; }
    /// Failed updates since boot.
    virtual uint32_t errors() const = 0;

protected:
    ~MotorDriver() = default;
};

} // namespace omni
