// SPDX-License-Identifier: MIT
/// @file setpoints.h  Streamed setpoints from the link: SET_POSITION_TARGET_LOCAL_NED, MANUAL_CONTROL,
/// OMNI_SETPOINT_DUTY.
///
/// A setpoint that is not finite, beyond the limits or not supported is refused as a whole. The last accepted one stays
/// in use until its timeout (SAFE_CMD_TO).
#pragma once

#include "app/link/legacy_line.h"
#include "app/services/parameters.h"
#include "app/services/robot_state.h"

namespace omni {

class Setpoints {
public:
    Setpoints(Texts &texts, const RobotClock &clock, const RobotState &robot, ControlLoop &control,
              const Parameters &parameters)
        : texts_(texts), clock_(clock), robot_(robot), control_(control), parameters_(parameters) {}

    /// Refuse a setpoint of a drive that has ended. Reported while armed; does not set refused(), which is for the
    /// station in command.
    void refuse_ended();
    void on_position_target(const Frame &frame);
    void on_manual_control(const Frame &frame);
    void on_duty(const Frame &frame);
    /// Setpoint line of the original robot (LINK2_LEGACY).
    void on_legacy_line(const LegacySetpoint &line);
    /// The latest setpoint was refused.
    bool refused() const { return refused_; }
    /// omni_setpoint_kind_t of the latest accepted setpoint; OMNI_SETPOINT_NONE after SAFE_CMD_TO.
    uint8_t streamed_kind() const;
    void restart();

private:
    void accept(const omni_setpoint_t &setpoint);
    void refuse(const char *why);
    const char *pose_target(const mavlink_set_position_target_local_ned_t &message, omni_setpoint_t *setpoint) const;
    const char *velocity_target(const mavlink_set_position_target_local_ned_t &message,
                                omni_setpoint_t *setpoint) const;
    float reach(const omni_twist_t &twist) const;
    float turn_towards(float yaw, float rate) const;
    const char *check_position(const omni_pose_t &pose) const;
    const char *check_twist(const omni_twist_t &twist) const;

    Texts &texts_;
    const RobotClock &clock_;
    const RobotState &robot_;
    ControlLoop &control_;
    const Parameters &parameters_;
    bool refused_ = false;
    uint8_t kind_ = OMNI_SETPOINT_NONE; ///< of the latest accepted one
    uint64_t accepted_us_ = 0;
    uint64_t last_text_us_[Board::max_ports] = {}; ///< per link
};

} // namespace omni
