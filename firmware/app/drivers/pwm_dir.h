// SPDX-License-Identifier: MIT
/// @file pwm_dir.h  A PWM pin and a direction pin of the processor per motor (MD10C, DRV8838 and their like).
///
/// PWM has the duty cycle |duty|; DIR is high for negative duties. Off and duty 0 are both PWM low, on which most
/// bridges brake. To coast when stopped, the robot needs the output-enable pin.
#pragma once

#include "app/drivers/pwm_pins.h"

namespace omni {

class PwmDir final : public PwmPins {
public:
    PwmDir() : PwmPins(OMNI_MOT_DRIVER_PWM_DIR) {}

private:
    MotorPinSteps steps_of(const omni_bridge_counts_t &bridge) const override {
        const bool backwards = bridge.in1 < bridge.in2;
        const int difference = backwards ? bridge.in2 - bridge.in1 : bridge.in1 - bridge.in2;
        return {static_cast<uint16_t>(difference), static_cast<uint16_t>(backwards ? OMNI_PWM_STEPS : 0)};
    }
};

} // namespace omni
