// SPDX-License-Identifier: MIT
/// @file heartbeats.h  Passes the relevant heartbeats to the tick, and reports changes of the station in command.
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

    /// Is this HEARTBEAT from a ground station (MAV_TYPE_GCS)? Those of cameras, companion computers and other robots
    /// do not prevent the link-loss fault.
    static bool is_ground_station(const Frame &frame);
    /// Record a ground station's heartbeat.
    void record(const Sender &sender);
    /// Put the sender of an accepted arm command in command; the command counts as a heartbeat.
    void armed_by(const Sender &sender);
    /// May this sender move the robot: it is not armed, or the sender is in command, or can take it because its
    /// heartbeats are valid? If not, both stations get a STATUSTEXT.
    /// @param streamed a setpoint: reported once a second.
    bool may_move(const Sender &sender, bool streamed = false);
    /// Put the sender of an accepted setpoint in command, if its heartbeats are valid.
    void take_command_by_setpoint(const Sender &sender);
    /// Is this sender streaming setpoints, accepted or not: is the latest at most this old?
    bool is_streaming(const Sender &sender, uint64_t max_age_us) const {
        return stations.is_streaming(sender, clock_.now_us, max_age_us);
    }
    /// Put the sender of an accepted arm or start command in command; starts a drive.
    void commanded(const Sender &sender);
    /// Put the sender of a hold in command; ends the drives of all others, starts none.
    void held(const Sender &sender);
    /// Inform the station whose drive was ended by another. @param did "stopped", "held", "taken over"
    void notify_displaced_station(const char *did, const Sender &sender);

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
    uint64_t refused_us_[Board::max_ports] = {}; ///< per link: last refusal of a sender that is not in command
    uint64_t told_us_ = 0;                       ///< last report of such a refusal to the station in command
};

} // namespace omni
