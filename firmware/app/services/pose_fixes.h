// SPDX-License-Identifier: MIT
/// @file pose_fixes.h  Pose fixes from external sensors: VICON_POSITION_ESTIMATE, ATT_POS_MOCAP, OMNI_POSE_FIX.
///
/// A time stamp within the last 0.25 s of the robot's clock is used; any other (such as Unix time) is replaced by now -
/// FIX_DELAY. OMNI_POSE_FIX must have the robot's clock: an older one is dropped. Also dropped: exact repetitions while
/// the wheels move the robot (frozen tracker), and exact zeros unless the estimate is near them (lost tracker).
///
/// The tick takes one per millisecond. Of a backlog after a pause of the link the newest `most_waiting` are kept;
/// dropped ones are reported.
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
    /// Process a new report of the tick.
    void take_report();
    /// Pass queued fixes to the tick. Once per pass and once per tick.
    void serve();

private:
    static constexpr size_t most_waiting = 8;
    void wait(const omni_pose_fix_t &fix);
    void accept(const omni_pose_t &world, uint64_t stamp_us, const float *covariance);
    void accept(const omni_pose_t &world, uint64_t stamp_us, float sd_xy, float sd_theta);
    uint64_t time_of(uint64_t stamp_us) const;
    bool frozen(const omni_pose_t &world);
    bool is_lost_tracker_zero(const omni_pose_t &world) const;
    void warn(const char *why);

    Texts &texts_;
    const RobotClock &clock_;
    const RobotState &robot_;
    ControlLoop &control_;
    const Parameters &parameters_;
    uint64_t last_text_us_[Board::max_ports] = {}; ///< per link
    omni_pose_t last_{};
    uint64_t last_us_ = 0;   ///< 0: no fix yet
    float travelled_ = 0.0f; ///< distance or turn by the wheels since the first arrival of `last_` [m or rad]
    omni_pose_fix_t waiting_[most_waiting] = {};
    size_t first_ = 0; ///< index of the oldest queued fix
    size_t count_ = 0;
    uint32_t restarts_ = 0; ///< restarts of the pose filter that have been reported
    FixDrift drift_;
};

} // namespace omni
