// SPDX-License-Identifier: MIT
/// @file trajectories.h  On-board trajectories by command: plans in the background, hands the plan to the tick.
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

    /// MAV_CMD_OMNI_TRAJECTORY_START. @param type TRJ_TYPE or -1, @param laps or -1, @param period_s or 0: the
    /// parameter's. @param sender that asks. @return MAV_RESULT
    uint8_t start(float type, float laps, float period_s, const Sender &sender);
    uint8_t stop();
    /// MAV_CMD_OMNI_WAYPOINT. Number 0 begins a list, which is that sender's: others add nothing to it, nor start it.
    uint8_t set_waypoint(float number, const omni_pose_t &pose, const Sender &sender);
    /// Arming: a path that the same station asked for while disarmed is planned anew from where the robot stands now,
    /// and starts. That of another station is forgotten.
    void on_arm(const Sender &sender);
    void on_disarm() { waiting_ = false; }
    /// This link has somebody else behind it: a path that was asked for there is forgotten, and a list from there.
    void forget(size_t link);
    /// Once per pass: a path that waits is forgotten if the robot stops, or if its station falls silent.
    void serve() {
        if (waiting_) {
            watch_asker();
        }
    }
    void restart() { waiting_ = false; }

private:
    bool stopped() const;
    void watch_asker();
    uint8_t plan(const Sender &sender);
    uint8_t refuse_waypoint(const char *why);
    bool accepts(int32_t parameter, float value, const char *name);
    void say_slowed(const omni_trajectory_t &path);

    Texts &texts_;
    const RobotClock &clock_;
    const RobotState &robot_;
    const Heartbeats &heartbeats_;
    ControlLoop &control_;
    const Parameters &parameters_;
    omni_waypoints_t waypoints_{};
    Sender lister_; ///< that sent the waypoints
    float type_ = -1.0f;
    float laps_ = -1.0f;
    float period_s_ = 0.0f;
    Sender asker_;
    uint64_t asked_us_ = 0; ///< when it asked for the path
    bool waiting_ = false;  ///< starts with arming
};

} // namespace omni
