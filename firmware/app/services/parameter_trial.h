// SPDX-License-Identifier: MIT
/// @file parameter_trial.h  Parameters on trial: restored automatically if the client disconnects.
#pragma once

#include "app/link/links.h"
#include "app/services/heartbeats.h"
#include "app/services/parameters.h"

namespace omni {

/// A client that tries parameters starts a trial first, and the robot saves the current values. If the connection is
/// closed, or the client's heartbeats time out (SAFE_LINK_TO), these values are restored as soon as the motors are off.
/// Not stored: a restart loads the stored parameters anyway.
class ParameterTrial {
public:
    ParameterTrial(const Board &board, Texts &texts, const RobotClock &clock, RobotState &robot,
                   const Heartbeats &heartbeats, Parameters &parameters)
        : board_(board), texts_(texts), clock_(clock), robot_(robot), heartbeats_(heartbeats), parameters_(parameters) {
    }

    /// MAV_CMD_OMNI_TRIAL. @param action 0: end, keep the values; 1: start; 2: end, restore the values; 3: query. Only
    /// the station that started a trial, or a hub on its link, can end it. @return MAV_RESULT
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
    Sender station_; ///< client of the trial
    uint32_t session_ = 0;
    bool on_ = false;
    bool over_ = false; ///< restore the values as soon as the motors are off
};

} // namespace omni
