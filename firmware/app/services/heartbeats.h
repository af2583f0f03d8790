// SPDX-License-Identifier: MIT
/// @file heartbeats.h  Which station is in command, and which heartbeats keep the robot going: they are passed on to
/// the tick.
#pragma once

#include <cstddef>

#include "app/base/robot_clock.h"
#include "app/link/stations.h"
#include "app/services/robot_state.h"
#include "app/tick/control_loop.h"

namespace omni {

class Heartbeats {
public:
    Heartbeats(const RobotClock &clock, const RobotState &robot, ControlLoop &control)
        : clock_(clock), robot_(robot), control_(control) {}

    /// A HEARTBEAT came. Only those of ground stations count (MAV_TYPE_GCS): a camera, a companion computer or another
    /// robot watches nothing.
    static bool is_of_station(const Frame &frame);
    /// A ground station gave a sign of life.
    void heard(const Sender &sender);
    /// An arm command was accepted: its sender is in command, and the command counts as a heartbeat.
    void armed_by(const Sender &sender);
    /// A set-point was accepted: its sender is in command from now on if its heartbeats come, too.
    void streamed(const Sender &sender);
    /// Its set-points come, used or not: the latest is at most this old.
    bool streams(const Sender &sender, uint64_t most_us) const {
        return stations.streams(sender, clock_.now_us, most_us);
    }
    /// The same of an arm or start command; it begins a drive.
    void commanded(const Sender &sender);
    /// The same of a hold. It ends the drives of all others, and begins none.
    void held(const Sender &sender);

    Stations stations;

private:
    void take_command(const Sender &sender);

    const RobotClock &clock_;
    const RobotState &robot_;
    ControlLoop &control_;
};

} // namespace omni
