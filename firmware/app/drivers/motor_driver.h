// SPDX-License-Identifier: MIT
/// @file motor_driver.h  What makes the motors turn, whatever chip or pins do it: one small interface, one class per
/// kind.
///
/// The core gives a duty per wheel. A driver turns the duties into signals, says whether they arrive, and switches all
/// of them off. ControlLoop adds the rules that hold for every driver: when the output-enable pin is on, how many
/// failures stop the robot.
///
/// All of it is called from the tick, and nothing waits.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"
#include "app/base/core.h"

namespace omni {

/// What leads to the motors: the board's, or the simulated world's in host-in-the-loop.
struct MotorWires {
    I2cBus &bus;
    OutputEnable &enable;
    MotorPins *pins; ///< nullptr: none
};

/// What the parameters say about the motors' wires.
struct Wiring {
    uint8_t wheels = 0;                ///< 3 or 4
    uint8_t in1[OMNI_MAX_WHEELS] = {}; ///< PWM channels of each wheel's bridge inputs, for a driver that has such
    uint8_t in2[OMNI_MAX_WHEELS] = {};
    uint8_t driver = OMNI_MOT_DRIVER_PCA9685; ///< omni_mot_driver
};

bool operator==(const Wiring &a, const Wiring &b);

class MotorDriver {
public:
    /// Begin again: nothing is known of the hardware, which may have lost its power or be driving.
    virtual void restart() = 0;
    /// Before the first tick, and between two ticks whenever the parameters change. The same wiring again changes
    /// nothing.
    virtual void set_wiring(const Wiring &wiring) = 0;
    /// Once per tick, before the control step: see how the last update went.
    virtual void poll(MotorWires &wires) = 0;
    /// Once per tick, after the control step: the next update, or the next step of setting up.
    /// @param duty one entry per wheel, -1..1. @param on false: all motors coast, or brake where the bridge cannot
    /// coast.
    virtual void drive(MotorWires &wires, uint64_t now_us, const omni_real_t *duty, bool on) = 0;
    /// Switch all motors off, in any state and without waiting; set up anew afterwards.
    /// @return false if that could not be sent now: call again.
    virtual bool all_off(MotorWires &wires) = 0;

    /// The hardware has answered and does what drive() says. Nobody arms before.
    virtual bool ready() const = 0;
    /// Updates in a row that did not arrive. One is due in each tick: one that turns out lost after three ticks was
    /// three.
    virtual uint16_t failures() const = 0;
    /// The hardware takes everything and what it reads back is never right, so that nobody knows what it does.
    virtual bool read_back_missing() const { return false; }
    /// Failed updates since boot.
    virtual uint32_t errors() const = 0;

protected:
    ~MotorDriver() = default;
};

} // namespace omni
