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

/// A ground station that leaves while it has the command stops the robot (link loss); another one's leaving is worth a word.
void StatusTexts::say_links() {
    if (!shared_.armed()) {
        return;
    }
    for (size_t link = 0; link < shared_.board.port_count; ++link) {
        const bool commands = shared_.stations.commander() == link;
        Text text;
        text.add("link ").add(static_cast<uint32_t>(link + 1));
        switch (shared_.stations.watch(link, shared_.now_us)) {
        case Stations::Change::lost:
            shared_.say(MAV_SEVERITY_WARNING,
                        text.add(commands ? " lost: it had the command" : " lost: its ground station is silent"));
            break;
        case Stations::Change::back:
            shared_.say(MAV_SEVERITY_INFO, text.add(" is back"));
            break;
        default:
            break;
        }
    }
}

/// Once on each link, from the press to the release of the stop.
void StatusTexts::say_button() {
    const bool pressed = shared_.button_pressed.load(std::memory_order_relaxed);
    for (size_t link = 0; link < shared_.board.port_count; ++link) {
        if (pressed && !button_said_[link] && shared_.links[link].connected()) {
            shared_.say_on(link, MAV_SEVERITY_CRITICAL, Text().add("stop button open: pressed, or its wire is cut"));
        }
        button_said_[link] = pressed && shared_.links[link].connected();
    }
}

void StatusTexts::serve() {
    say_links();
    say_button();
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
    phase_ = static_cast<uint8_t>(out.reference.phase);
    history_ = out.fault_history;
}

} // namespace omni
