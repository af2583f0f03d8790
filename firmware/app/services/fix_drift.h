// SPDX-License-Identifier: MIT
/// @file fix_drift.h  Whether pose fixes and wheels say the same motion, over seconds.
///
/// A fix that creeps is near to the estimate each time, so no gate refuses it, and a robot that holds its pose follows
/// it. Its sum over seconds shows it: the fixes go one way, the wheels another. Only a warning comes of this, because
/// wheels that slip look the same.
#pragma once

#include "app/services/robot_state.h"

namespace omni {

class FixDrift {
public:
    explicit FixDrift(Texts &texts) : texts_(texts) {}

    void restart();
    /// Once per report of the tick, with its wheel odometry.
    void take(const omni_outputs_t &outputs);
    /// A fix that was not refused on its way in. @param world where it says the robot is. @param armed a robot that
    /// is not may be carried.
    void compare(const omni_pose_t &world, bool armed);

private:
    void begin(const omni_pose_t &world);

    Texts &texts_;
    bool begun_ = false;
    omni_pose_t first_{};   ///< the fix at which the window began
    uint64_t first_us_ = 0; ///< when it came
    uint64_t last_fix_us_ = 0;
    uint64_t now_us_ = 0; ///< time of the latest report
    float x_ = 0.0f;      ///< gone by the wheels since `first_us_` [m], world frame
    float y_ = 0.0f;
    float theta_ = 0.0f;     ///< turned by the wheels since then [rad]
    float travelled_ = 0.0f; ///< length of that way [m]
    float turned_ = 0.0f;    ///< turned either way [rad]
    uint8_t apart_ = 0;      ///< windows in a row in which they disagreed
};

} // namespace omni
