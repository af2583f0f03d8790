// SPDX-License-Identifier: MIT
/// @file fix_drift.h  Detection of drifting pose fixes: motion by fixes against motion by wheels over seconds.
///
/// A slowly drifting fix passes the gate each time, and a robot that holds its pose follows it. Over seconds the two
/// motions diverge. Only a warning is raised, because slipping wheels look the same.
#pragma once

#include "app/services/robot_state.h"

namespace omni {

class FixDrift {
public:
    explicit FixDrift(Texts &texts) : texts_(texts) {}

    void restart();
    /// Integrate the wheel odometry of a tick's report.
    void take(const omni_outputs_t &outputs);
    /// Compare with an accepted fix. @param world its pose. @param armed false: no comparison, the robot may be
    /// carried.
    void compare(const omni_pose_t &world, bool armed);

private:
    void begin(const omni_pose_t &world);

    Texts &texts_;
    bool begun_ = false;
    omni_pose_t first_{};   ///< fix at the start of the window
    uint64_t first_us_ = 0; ///< its arrival
    uint64_t last_fix_us_ = 0;
    uint64_t now_us_ = 0; ///< time of the latest report
    float x_ = 0.0f;      ///< displacement by the wheels since `first_us_` [m], world frame
    float y_ = 0.0f;
    float theta_ = 0.0f;     ///< turn by the wheels since then [rad]
    float travelled_ = 0.0f; ///< distance by the wheels since then [m]
    float turned_ = 0.0f;    ///< |turn| summed since then [rad]
    uint8_t apart_ = 0;      ///< consecutive windows with a disagreement
};

} // namespace omni
