// SPDX-License-Identifier: MIT
/// @file heartbeats.h  Who has the command, and which signs of life keep the robot going: they are passed on to the
/// tick.
#pragma once

#include <cstddef>

#include "app/control_loop.h"
#include "app/robot_clock.h"
#include "app/robot_state.h"
#include "app/stations.h"

namespace omni {

class Heartbeats {
public:
    Heartbeats(const RobotClock &clock, const RobotState &robot, ControlLoop &control)
        : clock_(clock), robot_(robot), control_(control) {}

    /// A ground station gave a sign of life on this link.
    void heard(size_t link);
    /// A set-point or motion command of this link was accepted: it has the command from now on if its ground station is
    /// alive.
    void commanded(size_t link);

    Stations stations;

private:
    const RobotClock &clock_;
    const RobotState &robot_;
    ControlLoop &control_;
};

} // namespace omni
