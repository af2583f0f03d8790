// SPDX-License-Identifier: MIT
/// @file flow.h  The floor odometry sensor, if the robot file has one, on the third I2C bus, at 400 kHz.
///
/// A bus of its own, for the reasons of gyro.h. A reading of an OTOS is 0.25 ms on the wire, one of a Pinpoint 0.75 ms,
/// 50 times a second.
#pragma once

#include <type_traits>

#include "app/base/flow_chip.h"
#include "app/drivers/register_flow.h"
#include "boards/teensy40/i2c.h"
#include "omni/flow_gen.h"
#include "omni/wiring_gen.h"

namespace omni {

class Teensy40Flow {
public:
    FlowChip *begin() {
        bus_.begin();
        return &chip_;
    }

private:
    static constexpr uint32_t speed_Hz = 400'000;
    Teensy40FlowI2c bus_{speed_Hz};
    RegisterFlow chip_{bus_, wiring::flow_address, wiring::flow_chip};
};

/// A robot without one: no bus, no code, no memory.
class NoFlow {
public:
    FlowChip *begin() { return nullptr; }
};

using RobotFlow = std::conditional_t<wiring::flow_address != 0, Teensy40Flow, NoFlow>;

} // namespace omni
