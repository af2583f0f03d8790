// SPDX-License-Identifier: MIT
/// @file trajectories.h  On-board trajectories by command: planned in the background, followed by the tick.
#pragma once

#include "app/services/heartbeats.h"
#include "app/services/parameters.h"
#include "app/services/robot_state.h"

namespace omni {

class Trajectories {
public:
    Trajectories(Texts &texts, const RobotClock &clock, const RobotState &robot, const Heartbeats &heartbeats,
                 ControlLoop &control, const Parameters &parameters)
        : texts_(texts), clock_(clock), robot_(robot), heartbeats_(heartbeats), control_(control),
          parameters_(parameters) {}

    /// MAV_CMD_OMNI_TRAJECTORY_START. @param type TRJ_TYPE; -1: the parameter's. @param laps -1: the parameter's.
    /// @param period_s 0: the parameter's. @return MAV_RESULT
    uint8_t start(float type, float laps, float period_s, const Sender &sender);
    uint8_t stop();
    /// MAV_CMD_OMNI_WAYPOINT. Number 0 starts a list, owned by the sender: others can neither extend nor start it.
    uint8_t set_waypoint(float number, const omni_pose_t &pose, const Sender &sender);
    /// On arming: a trajectory requested by the same station while disarmed is planned again from the current pose and
    /// started; that of another station is dropped.
    void on_arm(const Sender &sender);
    void on_disarm() { waiting_ = false; }
    /// Drop the pending trajectory and the waypoint list of a link with a new peer.
    void forget(size_t link);
    /// Once per pass: drop a pending trajectory if the robot stops or its station times out.
    void serve() {
        if (waiting_) {
            watch_requester();
        }
    }
    void restart() { waiting_ = false; }

private:
    bool stopped() const;
    void watch_requester();
    uint8_t plan(const Sender &sender);
    uint8_t refuse_waypoint(const char *why);
    bool accepts(int32_t parameter, float value, const char *name);
    void report_slowdown(const omni_trajectory_t &path);

    Texts &texts_;
    const RobotClock &clock_;
    const RobotState &robot_;
    const Heartbeats &heartbeats_;
    ControlLoop &control_;
    const Parameters &parameters_;
    omni_waypoints_t waypoints_{};
    Sender waypoint_sender_; ///< owner of the waypoint list
    float type_ = -1.0f;
    float laps_ = -1.0f;
    float period_s_ = 0.0f;
    Sender requester_;
    uint64_t requested_us_ = 0; ///< time of the request
    bool waiting_ = false;      ///< a trajectory starts on arming
};

} // namespace omni
