// SPDX-License-Identifier: MIT
#include "app/services/robot_state.h"

namespace omni {
namespace {

/// Reports until a command is contained in one: one report may be pending, one tick may have processed its requests
/// before; the third one contains it.
constexpr uint8_t reports_until_known = 3;

} // namespace

void RobotState::restart(bool stopped) {
    latest_ = TickReport{};
    fix_ = FixReport{};
    if (stopped) {
        latest_.outputs.state = OMNI_STATE_ESTOP; // as the first tick will report
    }
    arming_ = 0;
    stopping_ = 0;
    releasing_ = 0;
}

void RobotState::take(const TickReport &report) {
    latest_ = report;
    stopping_ = static_cast<uint8_t>(stopping_ - (stopping_ > 0 ? 1 : 0));
    releasing_ = static_cast<uint8_t>(releasing_ - (releasing_ > 0 ? 1 : 0));
    if (arming_ > 0 && --arming_ == 0 && state() == OMNI_STATE_DISARMED) {
        // a fault that came with the command
        texts_.say(MAV_SEVERITY_WARNING, fault_text("not armed: ", latest_.arming_faults));
    }
}

void RobotState::set_setpoint_refused(bool refused) {
    latest_.outputs.faults &= ~static_cast<uint32_t>(OMNI_WARN_SETPOINT);
    latest_.outputs.faults |= refused ? static_cast<uint32_t>(OMNI_WARN_SETPOINT) : 0u;
}

void RobotState::set_arming_pending() {
    arming_ = reports_until_known;
}

void RobotState::set_release_pending() {
    releasing_ = reports_until_known;
}

void RobotState::set_stop_pending() {
    arming_ = 0;
    releasing_ = 0;
    stopping_ = reports_until_known;
}

uint8_t RobotState::refuse_armed(const char *what) {
    if (disarming()) {
        return MAV_RESULT_TEMPORARILY_REJECTED;
    }
    texts_.refuse(MAV_SEVERITY_WARNING, Text().add(what).add(": disarm first"));
    return MAV_RESULT_DENIED;
}

} // namespace omni
