// SPDX-License-Identifier: MIT
#include "app/drivers/pwm_pins.h"

namespace omni {

void PwmPins::restart() {
    ready_ = false;
    failures_ = 0;
}

void PwmPins::drive(MotorWires &wires, uint64_t, const omni_real_t *duty, bool on) {
    if (!wired(wires)) {
        ready_ = false;
        return;
    }
    MotorPinSteps steps[OMNI_MAX_WHEELS];
    for (size_t i = 0; i < wheels_; ++i) {
        steps[i] = steps_of(omni_bridge_counts(duty[i], on));
    }
    if (wires.pins->set_steps(steps, wheels_)) {
        ready_ = true;
        failures_ = 0;
    } else {
        ++errors_;
        failures_ = omni_add_failures(failures_, 1);
    }
}

bool PwmPins::all_off(MotorWires &wires) {
    PwmPins::restart();
    if (wired(wires)) {
        const MotorPinSteps low[OMNI_MAX_WHEELS];
        wires.pins->set_steps(low, OMNI_MAX_WHEELS);
    }
    return true;
}

} // namespace omni
