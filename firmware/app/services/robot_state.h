// SPDX-License-Identifier: MIT
/// @file robot_state.h  State of the robot as seen by the background: the last tick's report, and pending stop and arm
/// commands that no report contains yet.
#pragma once

#include <cstdint>

#include "app/link/texts.h"
#include "app/tick/control_loop.h"

namespace omni {

class RobotState {
public:
    explicit RobotState(Texts &texts) : texts_(texts) {}

    /// Reset. @param stopped the first tick will start in an e-stop.
    void restart(bool stopped);
    /// Process a new report of the tick.
    void take(const TickReport &report);
    /// Process the tick's result for a pose fix.
    void take(const FixReport &fix) { fix_ = fix; }
    /// Set OMNI_WARN_SETPOINT in the last report: the tick does not see refused setpoints.
    void set_setpoint_refused(bool refused);
    /// omni_setpoint_kind_t of the streamed setpoints, or OMNI_SETPOINT_NONE. Also valid while disarmed, when the tick
    /// ignores them.
    uint8_t streamed_kind() const { return streamed_kind_; }
    void set_streamed_kind(uint8_t kind) { streamed_kind_ = kind; }
    /// Report of the last tick, updated once per background pass.
    const TickReport &latest() const { return latest_; }
    /// Result of the latest pose fix.
    const FixReport &fix() const { return fix_; }
    uint8_t state() const { return latest_.outputs.state; }

    /// Mark an accepted arm command as pending.
    void set_arming_pending();
    /// Mark a disarm or e-stop as pending.
    void set_stop_pending();
    /// Mark an accepted release of an e-stop as pending.
    void set_release_pending();
    /// A release is pending: not contained in a report yet.
    bool releasing() const { return releasing_ > 0; }
    /// An arm command is pending.
    bool arming() const { return arming_ > 0; }
    /// A stop is pending.
    bool stopping() const { return stopping_ > 0; }
    /// Armed, in failsafe, or arming is pending: operations that are not allowed while armed are refused.
    bool armed() const { return arming() || state() == OMNI_STATE_ARMED || state() == OMNI_STATE_FAILSAFE; }
    /// Armed with a pending stop: such operations will be allowed in a moment.
    bool disarming() const { return armed() && stopping(); }
    /// Refuse a command because the robot is armed, with a text to the requester. @param what name of the operation.
    /// @return MAV_RESULT; TEMPORARILY_REJECTED if a stop is pending, as stops are acknowledged before their report.
    uint8_t refuse_armed(const char *what);
    /// Hint for a refusal while armed.
    const char *disarm_hint() const { return disarming() ? "still stopping, try again" : "disarm first"; }

    /// Hardware-in-the-loop is active.
    bool hil() const { return hil_; }
    void set_hil(bool hil) { hil_ = hil; }
    /// Name of an invalid parameter of the robot file: fallback values are in use, arming is refused. nullptr: none.
    const char *unusable_value() const { return unusable_value_; }
    void set_unusable_value(const char *name) { unusable_value_ = name; }
    /// A reboot was requested.
    bool reboot_requested() const { return reboot_requested_; }
    void request_reboot() { reboot_requested_ = true; }

private:
    Texts &texts_;
    TickReport latest_;
    FixReport fix_;
    uint8_t stopping_ = 0;  ///< reports until a pending disarm or e-stop is contained in one
    uint8_t releasing_ = 0; ///< reports until a pending release is contained in one
    uint8_t arming_ = 0;    ///< reports until a pending arm command is contained in one
    uint8_t streamed_kind_ = 0;
    const char *unusable_value_ = nullptr;
    bool hil_ = false;
    bool reboot_requested_ = false;
};

} // namespace omni
