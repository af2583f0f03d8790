// SPDX-License-Identifier: MIT
/// @file parameter_trial.h  Parameters on trial: the robot takes them back by itself if whoever tries them has gone.
#pragma once

#include "app/link/links.h"
#include "app/services/heartbeats.h"
#include "app/services/parameters.h"

namespace omni {

/// A program that tries parameters begins a trial first. The robot remembers what is in use then. If that connection is
/// closed, or its ground station falls silent for SAFE_LINK_TO, these values come back, as soon as the motors are off.
/// Nothing of this is stored: a restart brings the stored parameters anyway.
class ParameterTrial {
public:
    ParameterTrial(const Board &board, Texts &texts, const RobotClock &clock, RobotState &robot,
                   const Heartbeats &heartbeats, Parameters &parameters)
        : board_(board), texts_(texts), clock_(clock), robot_(robot), heartbeats_(heartbeats), parameters_(parameters) {
    }

    /// MAV_CMD_OMNI_TRIAL. @param action 0 end, keep what is in use; 1 begin; 2 end, back to what was in use; 3 does it
    /// go on? Only the station that began a trial can end it, and a hub on its link. @return MAV_RESULT
    uint8_t command(float action, const Sender &sender);
    /// Once per pass of the background.
    void serve();

    bool on() const { return on_; }

private:
    uint8_t refuse(const char *why);
    bool is_own(const Sender &sender) const;
    uint8_t begin(const Sender &sender);

    const Board &board_;
    Texts &texts_;
    const RobotClock &clock_;
    RobotState &robot_;
    const Heartbeats &heartbeats_;
    Parameters &parameters_;
    omni_real_t before_[OMNI_PARAM_COUNT] = {};
    Sender station_; ///< that began it
    uint32_t session_ = 0;
    bool on_ = false;
    bool over_ = false; ///< the values from before come back as soon as the motors are off
};

} // namespace omni
