// SPDX-License-Identifier: MIT
/// @file pwm_dir.h  A PWM pin and a direction pin of the processor per motor (MD10C, DRV8838 and their like).
///
/// PWM is high for the share of the duty; DIR is high for negative duties. Off and duty 0 are both PWM low: what the
/// bridge makes of that is its own affair, most of them brake. A robot that shall coast when it is stopped needs the
/// output-enable pin.
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
