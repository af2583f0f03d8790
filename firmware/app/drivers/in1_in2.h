// SPDX-License-Identifier: MIT
/// @file in1_in2.h  Two PWM pins of the processor per motor, to IN1 and IN2 of an H-bridge (DRV8871, DRV8833, TB6612
/// and their like).
///
/// Driving: one input is high, the other low for the duty cycle; between pulses the bridge brakes. Duty 0:
/// both high, brake. Off: both low, coast.
#pragma once

#include "app/drivers/pwm_pins.h"

namespace omni {

class In1In2 final : public PwmPins {
public:
    In1In2() : PwmPins(OMNI_MOT_DRIVER_IN1_IN2) {}

private:
    MotorPinSteps steps_of(const omni_bridge_counts_t &bridge) const override { return {bridge.in1, bridge.in2}; }
};

} // namespace omni
