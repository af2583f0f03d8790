// SPDX-License-Identifier: MIT
/// @file robot_state.h  What the background knows of the robot. That is the last tick's report, and the stops and arm
/// commands that are on their way to the next one.
#pragma once

#include <cstdint>

#include "app/link/texts.h"
#include "app/tick/control_loop.h"

namespace omni {

class RobotState {
public:
    explicit RobotState(Texts &texts) : texts_(texts) {}

    /// Nothing is known yet, and nothing is on its way. @param stopped the first tick will come up in an emergency
    /// stop.
    void restart(bool stopped);
    /// The tick has reported once more.
    void take(const TickReport &report);
    /// The tick has looked at a pose fix.
    void take(const FixReport &fix) { fix_ = fix; }
    /// Show in the last report whether the latest set-point was refused, which the tick never sees.
    void show_refused_setpoint(bool refused);
    /// omni_setpoint_kind_t of the set-points that are being streamed, or OMNI_SETPOINT_NONE: a disarmed robot's tick
    /// looks at none.
    uint8_t streamed_kind() const { return streamed_kind_; }
    void show_streamed(uint8_t kind) { streamed_kind_ = kind; }
    /// Report of the last tick, refreshed once per background pass.
    const TickReport &latest() const { return latest_; }
    /// The latest pose fix that the tick has looked at.
    const FixReport &fix() const { return fix_; }
    uint8_t state() const { return latest_.outputs.state; }

    /// An arm command was accepted.
    void expect_arming();
    /// A disarm or an emergency stop was asked for.
    void expect_stop();
    /// The release of an emergency stop was accepted.
    void expect_release();
    /// A release was accepted, and no report tells yet what became of it.
    bool releasing() const { return releasing_ > 0; }
    /// An arm command was accepted, and no report tells yet what became of it.
    bool arming() const { return arming_ > 0; }
    /// A stop was asked for, and no report tells yet what became of it.
    bool stopping() const { return stopping_ > 0; }
    /// Motors may move, or would but for a fault: what is locked while armed is locked now.
    bool armed() const { return arming() || state() == OMNI_STATE_ARMED || state() == OMNI_STATE_FAILSAFE; }
    /// A stop is on its way, and no report of it has come yet. What is locked while armed is free in a moment.
    bool disarming() const { return armed() && stopping(); }
    /// Why not, of a command that is locked while armed. Its text goes to whoever asked. @param what is not done.
    /// @return MAV_RESULT: behind a stop it is to be tried again, since the answer to a stop comes before its report.
    uint8_t refuse_armed(const char *what);
    /// The same where there is no result to give: what helps.
    const char *way_out_of_armed() const { return disarming() ? "still stopping, try again" : "disarm first"; }

    /// Host-in-the-loop. The application enters and leaves it.
    bool hil() const { return hil_; }
    void set_hil(bool hil) { hil_ = hil; }
    /// Name of a value of the robot's own that fits no robot: it works with others, and does not arm. nullptr: all fit.
    const char *misfit() const { return misfit_; }
    void set_misfit(const char *name) { misfit_ = name; }
    /// A reboot was asked for.
    bool reboot() const { return reboot_; }
    void ask_reboot() { reboot_ = true; }

private:
    Texts &texts_;
    TickReport latest_;
    FixReport fix_;
    uint8_t stopping_ = 0;  ///< reports to wait for until one tells what became of a disarm or an emergency stop
    uint8_t releasing_ = 0; ///< reports to wait for until one tells what became of a release
    uint8_t arming_ = 0;    ///< reports to wait for until one tells what became of an accepted arm command
    uint8_t streamed_kind_ = 0;
    const char *misfit_ = nullptr;
    bool hil_ = false;
    bool reboot_ = false;
};

} // namespace omni
