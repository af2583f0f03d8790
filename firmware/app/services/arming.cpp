// SPDX-License-Identifier: MIT
#include "app/services/arming.h"

#include "app/base/core.h"
#include "app/base/flash_code.h"

namespace omni {
namespace {

/// Before the first tick, or during the motor driver's first initialisation without an error so far.
bool starting_up(const TickReport &latest) {
    const uint32_t others = latest.arming_faults & ~static_cast<uint32_t>(OMNI_FAULT_LINK_LOSS);
    const bool driver_not_yet = others == OMNI_FAULT_DRIVER && latest.i2c_errors == 0;
    return latest.outputs.state == OMNI_STATE_INIT || driver_not_yet;
}

} // namespace

uint8_t Arming::command(float wanted, const Sender &sender) {
    if (wanted == 1.0f) {
        return arm(sender);
    }
    // Always possible, in every state; force (param2 = 21196) is not needed and ignored.
    return wanted == 0.0f ? stop(OMNI_EVENT_DISARM, sender) : static_cast<uint8_t>(MAV_RESULT_DENIED);
}

/// Warn once that motors cannot be stopped without the bus.
void Arming::warn_missing_output_enable() {
    if (!pin_said_ && !robot_.hil() && !conditions_.output_enable.wired()) {
        pin_said_ = true;
        texts_.say(MAV_SEVERITY_NOTICE, Text().add("no output-enable pin: a dead bus cannot be stopped"));
    }
}

OMNI_COLD uint8_t Arming::arm(const Sender &sender) {
    const uint8_t state = robot_.state();
    if (robot_.reboot_requested()) {
        texts_.refuse(MAV_SEVERITY_WARNING, Text().add("cannot arm: rebooting"));
        return MAV_RESULT_DENIED;
    }
    if (robot_.stopping() &&
        (state == OMNI_STATE_ARMED || state == OMNI_STATE_FAILSAFE || state == OMNI_STATE_DISARMED)) {
        return MAV_RESULT_TEMPORARILY_REJECTED; // a stop is pending: in the same tick it would have
                                                // priority
    }
    if ((state == OMNI_STATE_ARMED || robot_.arming()) && !heartbeats_.may_move(sender)) {
        return MAV_RESULT_DENIED;
    }
    if (state == OMNI_STATE_ARMED) {
        heartbeats_.commanded(sender);
        return MAV_RESULT_ACCEPTED;
    }
    if (robot_.unusable_value() != nullptr) {
        texts_.refuse(MAV_SEVERITY_WARNING, Text().add("cannot arm: own values do not fit"));
        return MAV_RESULT_DENIED;
    }
    if (conditions_.hil.hil_silent()) {
        texts_.refuse(MAV_SEVERITY_WARNING, Text().add("cannot arm: no sensor readings yet"));
        return MAV_RESULT_TEMPORARILY_REJECTED;
    }
    if (conditions_.scan.running()) {
        texts_.refuse(MAV_SEVERITY_NOTICE, Text().add("cannot arm yet: I2C scan"));
        return MAV_RESULT_TEMPORARILY_REJECTED;
    }
    if (starting_up(robot_.latest())) {
        texts_.refuse(MAV_SEVERITY_NOTICE, Text().add("cannot arm yet: starting up"));
        return MAV_RESULT_TEMPORARILY_REJECTED;
    }
    if (state == OMNI_STATE_ESTOP && robot_.releasing()) {
        return MAV_RESULT_TEMPORARILY_REJECTED; // the release is pending
    }
    if (state != OMNI_STATE_DISARMED) {
        const char *name = omni_safety_state_name(static_cast<omni_safety_state_t>(state));
        const char *way_out = state == OMNI_STATE_ESTOP ? " (release it first)" : " (disarm first)";
        texts_.refuse(MAV_SEVERITY_WARNING, Text().add("cannot arm: ").add(name).add(way_out));
        return MAV_RESULT_DENIED;
    }
    const uint32_t faults = robot_.latest().arming_faults & ~static_cast<uint32_t>(OMNI_FAULT_LINK_LOSS);
    if (faults != 0) {
        texts_.refuse(MAV_SEVERITY_WARNING, fault_text("cannot arm: ", faults));
        // Wheels that still turn come to rest by themselves.
        return faults == OMNI_FAULT_OVERSPEED ? MAV_RESULT_TEMPORARILY_REJECTED : MAV_RESULT_DENIED;
    }
    if (!signing_.store_for_drive()) {
        texts_.say(MAV_SEVERITY_ERROR, Text().add("the memory failed: signing time not stored"));
    }
    heartbeats_.armed_by(sender);
    if (!control_.request_event(OMNI_EVENT_ARM)) {
        return MAV_RESULT_TEMPORARILY_REJECTED;
    }
    robot_.set_arming_pending();
    warn_missing_output_enable();
    trajectories_.on_arm(sender);
    return MAV_RESULT_ACCEPTED;
}

uint8_t Arming::stop(uint32_t event, const Sender &sender) {
    trajectories_.on_disarm();
    control_.plans.withdraw();
    control_.stop(event);
    robot_.set_stop_pending();
    heartbeats_.notify_displaced_station("stopped", sender);
    heartbeats_.stations.end_other_drives(sender);
    return MAV_RESULT_ACCEPTED;
}

uint8_t Arming::estop(const Sender &sender) {
    return stop(OMNI_EVENT_ESTOP, sender);
}

uint8_t Arming::estop_or_release(float stop, const Sender &sender) {
    return stop == 0.0f ? release() : estop(sender);
}

uint8_t Arming::release() {
    if (robot_.disarming()) {
        return MAV_RESULT_TEMPORARILY_REJECTED; // in the same tick the stop has priority
    }
    if (robot_.armed()) {
        texts_.refuse(MAV_SEVERITY_WARNING, Text().add("there is no emergency stop to release"));
        return MAV_RESULT_DENIED;
    }
    if (button_.open()) {
        texts_.refuse(MAV_SEVERITY_WARNING, Text().add("not released: the stop button is still open"));
        return MAV_RESULT_DENIED;
    }
    if (control_.stopping(OMNI_EVENT_ESTOP)) {
        return MAV_RESULT_TEMPORARILY_REJECTED; // in the same tick the stop has priority
    }
    button_.release();
    if (!control_.request_event(OMNI_EVENT_ESTOP_CLEAR)) {
        return MAV_RESULT_TEMPORARILY_REJECTED;
    }
    robot_.set_release_pending();
    return MAV_RESULT_ACCEPTED;
}

} // namespace omni
