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
    Heartbeats(Texts &texts, const RobotClock &clock, const RobotState &robot, ControlLoop &control)
        : texts_(texts), clock_(clock), robot_(robot), control_(control) {}

    /// A HEARTBEAT came. Only those of ground stations count (MAV_TYPE_GCS): a camera, a companion computer or another
    /// robot watches nothing.
    static bool is_of_station(const Frame &frame);
    /// A ground station gave a sign of life.
    void heard(const Sender &sender);
    /// An arm command was accepted: its sender is in command, and the command counts as a heartbeat.
    void armed_by(const Sender &sender);
    /// Whether set-points and motion commands of this sender count: the robot is not armed, or the sender has the
    /// command, or its heartbeats come, so that it can take it. If not, both stations are told.
    /// @param streamed a set-point: its sender is told once a second.
    bool may_move(const Sender &sender, bool streamed = false);
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
    /// For the station whose drive another one ended. @param did "stopped", "held", "taken over"
    void tell_who(const char *did, const Sender &sender);

    Stations stations;

private:
    void refuse_motion(const Sender &sender, bool streamed);
    bool can_take_command(const Sender &sender) const;
    void take_command(const Sender &sender);
    void take_over(const Sender &sender);

    Texts &texts_;
    const RobotClock &clock_;
    const RobotState &robot_;
    ControlLoop &control_;
    uint64_t refused_us_[Board::max_ports] = {}; ///< per link, when a sender there was told that another one commands
    uint64_t told_us_ = 0;                       ///< when the station in command was told of one
};

} // namespace omni
