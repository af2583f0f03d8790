// SPDX-License-Identifier: MIT
/// @file pose_fixes.h  Poses measured outside the robot: VICON_POSITION_ESTIMATE, ATT_POS_MOCAP, OMNI_POSE_FIX.
///
/// A time stamp within the last 0.25 s of the robot's clock is believed. In place of any other (Unix time, say)
/// FIX_DELAY before now is taken. OMNI_POSE_FIX has the robot's clock and no other: an older one is not used. A sensor
/// that has frozen repeats its fix digit by digit, although the wheels have moved the robot meanwhile. Such a fix is
/// not used. Nor is one of exact zeros, unless the estimate is near them.
///
/// The tick uses one per millisecond. Of a backlog, as a link delivers it after a pause, the newest `most_waiting` are
/// kept. All others are dropped, which is said: what is older helps the estimate no more.
#pragma once

#include "app/services/fix_drift.h"
#include "app/services/parameters.h"
#include "app/services/robot_state.h"

namespace omni {

class PoseFixes {
public:
    PoseFixes(Texts &texts, const RobotClock &clock, const RobotState &robot, ControlLoop &control,
              const Parameters &parameters)
        : texts_(texts), clock_(clock), robot_(robot), control_(control), parameters_(parameters), drift_(texts) {}

    void on_vicon(const Frame &frame);
    void on_mocap(const Frame &frame);
    void on_compact(const Frame &frame);
    void restart();
    /// The tick has reported once more.
    void take_report();
    /// Pass on what waits. Once per pass, and once per tick.
    void serve();

private:
    static constexpr size_t most_waiting = 8;
    void wait(const omni_pose_fix_t &fix);
    void accept(const omni_pose_t &world, uint64_t stamp_us, const float *covariance);
    void accept(const omni_pose_t &world, uint64_t stamp_us, float sd_xy, float sd_theta);
    uint64_t time_of(uint64_t stamp_us) const;
    bool frozen(const omni_pose_t &world);
    bool zeros_of_lost(const omni_pose_t &world) const;
    void complain(const char *why);

    Texts &texts_;
    const RobotClock &clock_;
    const RobotState &robot_;
    ControlLoop &control_;
    const Parameters &parameters_;
    uint64_t said_us_[Board::max_ports] = {}; ///< per link
    omni_pose_t last_{};
    uint64_t last_us_ = 0;   ///< 0: no fix yet
    float travelled_ = 0.0f; ///< by the wheels since `last_` came first [m or rad]
    omni_pose_fix_t waiting_[most_waiting] = {};
    size_t first_ = 0; ///< the oldest that waits
    size_t count_ = 0;
    uint32_t restarts_ = 0; ///< of the pose filter, that have been said
    FixDrift drift_;
};

} // namespace omni
