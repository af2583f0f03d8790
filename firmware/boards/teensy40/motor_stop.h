// SPDX-License-Identifier: MIT
/// @file motor_stop.h  Switches the motors off by the bus alone where no control loop runs: at start-up and before the
/// bootloader.
///
/// The PWM chip keeps its last duties while the processor restarts. Where its output-enable pin is not
/// wired this is the only thing that stops a motor.
#pragma once

#include "app/base/board.h"

namespace omni {

class MotorStop {
public:
    /// Poll the bus and, if it is free, send ALL_LED_OFF; a stuck bus is freed. Never waits. With the tick's
    /// priority, or interrupts locked.
    /// @return true if the chip has acknowledged since the last true.
    bool step(I2cBus &bus);

private:
    bool sent_ = false;
};

} // namespace omni
