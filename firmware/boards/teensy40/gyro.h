// SPDX-License-Identifier: MIT
/// @file gyro.h  The gyro's chip, if the robot file has one, on the second I2C bus, at 400 kHz.
///
/// A bus of its own, because the motors' bus must not wait for a chip that they do not need. Not SPI: its clock is pin
/// 13, the LED's. The interrupts have the priority of the motors' bus. So each waits for the other's for a
/// microsecond. The masters stretch the clock meanwhile, and a batch of the motors' has half a millisecond to spare. A
/// reading of six bytes is 0.24 ms on the wire, a piece of a configuration file 0.86 ms.
#pragma once

#include <type_traits>

#include "app/base/gyro_chip.h"
#include "app/drivers/register_gyro.h"
#include "boards/teensy40/i2c.h"
#include "omni/gyro_gen.h"
#include "omni/wiring_gen.h"

namespace omni {

class Teensy40Gyro {
public:
    GyroChip *begin() {
        bus_.begin();
        return &chip_;
    }

private:
    static constexpr uint32_t speed_Hz = 400'000;
    Teensy40GyroI2c bus_{speed_Hz};
    RegisterGyro chip_{bus_, wiring::gyro_address, wiring::gyro_registers, wiring::gyro_configuration,
                       wiring::gyro_configuration_size};
};

/// A robot without one: no bus, no code, no memory.
class NoGyro {
public:
    GyroChip *begin() { return nullptr; }
};

using RobotGyro = std::conditional_t<wiring::gyro_address != 0, Teensy40Gyro, NoGyro>;

} // namespace omni
