// SPDX-License-Identifier: MIT
#include "app/status_texts.h"

#include "app/core.h"

namespace omni {

void StatusTexts::restart() {
    state_ = OMNI_STATE_INIT;
    phase_ = OMNI_PHASE_NONE;
    history_ = 0;
}

void StatusTexts::say_state(uint8_t state) {
    const bool alarm = state == OMNI_STATE_FAILSAFE || state == OMNI_STATE_ESTOP;
    const char *name = omni_safety_state_name(static_cast<omni_safety_state_t>(state));
    shared_.say(alarm ? MAV_SEVERITY_CRITICAL : MAV_SEVERITY_INFO, Text().add(name));
}

void StatusTexts::serve() {
    const omni_outputs_t &out = shared_.latest.outputs;
    if (out.state == OMNI_STATE_FAILSAFE && (out.state != state_ || (out.fault_history & ~history_) != 0)) {
        shared_.say(MAV_SEVERITY_CRITICAL, fault_text("failsafe: ", out.fault_history));
    } else if (out.state != state_) {
        say_state(out.state);
    }
    if (out.reference.phase == OMNI_PHASE_DONE && phase_ != OMNI_PHASE_DONE) {
        shared_.say(MAV_SEVERITY_INFO, Text().add("trajectory done"));
    }
    state_ = out.state;
    phase_ = out.reference.phase;
    history_ = out.fault_history;
}

} // namespace omni
