// SPDX-License-Identifier: MIT
#include "app/services/setpoints.h"

#include <algorithm>

#include "app/base/core.h"
#include "app/base/flash_code.h"
#include "app/link/frames.h"

namespace omni {
namespace {

/// Tolerance for a limit sent as the nearest float.
constexpr float rounding = 1.00001f;

constexpr unsigned ignore_position = POSITION_TARGET_TYPEMASK_X_IGNORE | POSITION_TARGET_TYPEMASK_Y_IGNORE;
constexpr unsigned ignore_velocity = POSITION_TARGET_TYPEMASK_VX_IGNORE | POSITION_TARGET_TYPEMASK_VY_IGNORE;
constexpr unsigned ignore_yaw = POSITION_TARGET_TYPEMASK_YAW_IGNORE;
constexpr unsigned ignore_yaw_rate = POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE;

/// MANUAL_CONTROL axis as -1..1; INT16_MAX means there is no such axis.
float axis_share(int16_t value) {
    return value == INT16_MAX ? 0.0f : omni_clampf(static_cast<float>(value) * 0.001f, -1.0f, 1.0f);
}

} // namespace

void Setpoints::restart() {
    refused_ = false;
    kind_ = OMNI_SETPOINT_NONE;
    std::fill(last_text_us_, last_text_us_ + Board::max_ports, uint64_t{0});
}

void Setpoints::accept(const omni_setpoint_t &setpoint) {
    omni_setpoint_t stamped = setpoint;
    stamped.time_us = clock_.now_us;
    control_.set_setpoint(stamped);
    refused_ = false;
    kind_ = stamped.kind;
    accepted_us_ = stamped.time_us;
}

uint8_t Setpoints::streamed_kind() const {
    const float age_s = 1e-6f * static_cast<float>(clock_.now_us - accepted_us_);
    return age_s <= parameters_.config().limits.command_timeout_s ? kind_ : static_cast<uint8_t>(OMNI_SETPOINT_NONE);
}

OMNI_COLD void Setpoints::refuse(const char *why) {
    refused_ = true;
    texts_.refuse_rate_limited(last_text_us_, Text().add("setpoint refused: ").add(why));
}

OMNI_COLD void Setpoints::refuse_ended() {
    if (robot_.armed()) {
        texts_.refuse_rate_limited(last_text_us_, Text().add("setpoint refused: its drive has ended"));
    }
}

const char *Setpoints::check_twist(const omni_twist_t &twist) const {
    const omni_limits_t &limits = parameters_.config().limits;
    if (!omni_twist_is_finite(&twist)) {
        return "velocity is not finite";
    }
    const float speed = omni_sqrtf(twist.vx * twist.vx + twist.vy * twist.vy);
    if (speed > limits.speed_m_s * rounding) {
        return "speed beyond LIM_V";
    }
    return omni_absf(twist.wz) > limits.turn_rad_s * rounding ? "turn rate beyond LIM_W" : nullptr;
}

const char *Setpoints::check_position(const omni_pose_t &pose) const {
    if (!omni_pose_is_finite(&pose)) {
        return "pose is not finite";
    }
    const float limit = parameters_.config().limits.position_m;
    return omni_absf(pose.x) > limit || omni_absf(pose.y) > limit ? "position beyond LIM_POS" : nullptr;
}

/// @return nullptr, or the reason for refusal.
const char *Setpoints::pose_target(const mavlink_set_position_target_local_ned_t &message,
                                   omni_setpoint_t *setpoint) const {
    const unsigned mask = message.type_mask;
    if (message.coordinate_frame != MAV_FRAME_LOCAL_NED) {
        return "a pose needs frame LOCAL_NED";
    }
    if ((mask & ignore_position) != 0) {
        return "x and y belong together";
    }
    const omni_pose_t held = flip_frame(robot_.latest().outputs.reference.pose);
    const omni_pose_t ned = {message.x, message.y, (mask & ignore_yaw) != 0 ? held.theta : message.yaw};
    omni_twist_t rate = {0.0f, 0.0f, 0.0f};
    if ((mask & ignore_velocity) == 0) {
        rate.vx = message.vx;
        rate.vy = message.vy;
    }
    if ((mask & ignore_yaw_rate) == 0) {
        rate.wz = message.yaw_rate;
    }
    const char *why = check_position(ned);
    if (why != nullptr) {
        return why;
    }
    setpoint->kind = OMNI_SETPOINT_POSE;
    setpoint->pose = flip_frame(ned);
    setpoint->twist = flip_frame(rate);
    return check_twist(rate);
}

/// The rate that ends a heading error in SAFE_CMD_TO, but not in less than half a second. So the robot does not turn
/// too far before the next setpoint arrives, at any rate of setpoints. Rate and result in NED. @param rate feed-forward
float Setpoints::turn_towards(float yaw, float rate) const {
    constexpr float quickest_s = 0.5f;
    const omni_limits_t &limits = parameters_.config().limits;
    const float error = omni_wrap_pi(yaw - flip_frame(robot_.latest().outputs.pose).theta);
    const float wanted = rate + error / std::max(limits.command_timeout_s, quickest_s);
    return omni_clampf(wanted, -limits.turn_rad_s, limits.turn_rad_s);
}

const char *Setpoints::velocity_target(const mavlink_set_position_target_local_ned_t &message,
                                       omni_setpoint_t *setpoint) const {
    const unsigned mask = message.type_mask;
    if ((mask & ignore_velocity) == ignore_velocity && (mask & ignore_yaw_rate) != 0) {
        return "the mask ignores everything";
    }
    const bool body = message.coordinate_frame == MAV_FRAME_BODY_FRD || message.coordinate_frame == MAV_FRAME_BODY_NED;
    if (!body && message.coordinate_frame != MAV_FRAME_LOCAL_NED) {
        return "frame must be 1, 8 or 12";
    }
    omni_twist_t twist = {0.0f, 0.0f, 0.0f};
    twist.vx = (mask & POSITION_TARGET_TYPEMASK_VX_IGNORE) != 0 ? 0.0f : message.vx;
    twist.vy = (mask & POSITION_TARGET_TYPEMASK_VY_IGNORE) != 0 ? 0.0f : message.vy;
    twist.wz = (mask & ignore_yaw_rate) != 0 ? 0.0f : message.yaw_rate;
    if ((mask & ignore_yaw) == 0) {
        if (!omni_is_finite(message.yaw)) {
            return "yaw is not finite";
        }
        twist.wz = turn_towards(message.yaw, twist.wz);
    }
    setpoint->kind = body ? OMNI_SETPOINT_VELOCITY_BODY : OMNI_SETPOINT_VELOCITY_WORLD;
    setpoint->twist = flip_frame(twist);
    return check_twist(twist);
}

void Setpoints::on_position_target(const Frame &frame) {
    const auto message = frame.as<mavlink_set_position_target_local_ned_t>();
    omni_setpoint_t setpoint{};
    const bool position = (message.type_mask & ignore_position) != ignore_position;
    const char *why = position ? pose_target(message, &setpoint) : velocity_target(message, &setpoint);
    if (why == nullptr) {
        accept(setpoint);
    } else {
        refuse(why);
    }
}

/// Speed of the body at which the first wheel reaches LIM_WHEEL or its motor's speed without load, per unit of `twist`.
/// @param twist of the body, not zero
OMNI_COLD float Setpoints::reach(const omni_twist_t &twist) const {
    const omni_robot_config_t &config = parameters_.config();
    const omni_trajectory_config_t &motor = config.trajectory;
    omni_real_t wheel[OMNI_MAX_WHEELS] = {0};
    omni_kinematics_inverse(&config.kinematics, &twist, nullptr, wheel);
    float fastest = 0.0f;
    for (uint8_t i = 0; i < config.kinematics.wheels; ++i) {
        fastest = std::max(fastest, omni_absf(wheel[i]));
    }
    const float by_limit = config.limits.wheel_rad_s / fastest;
    return std::min(by_limit, motor.voltage_limit_V / (motor.ff_speed_V_s * fastest));
}

/// Sticks as joystick tools send them: x forward, y right, r to the right (clockwise). Full deflection is the
/// maximum speed in that direction, limited to LIM_V and LIM_W.
void Setpoints::on_manual_control(const Frame &frame) {
    const auto message = frame.as<mavlink_manual_control_t>();
    const omni_limits_t &limits = parameters_.config().limits;
    omni_twist_t stick = {axis_share(message.x), axis_share(message.y), axis_share(message.r)};
    const float length = omni_sqrtf(stick.vx * stick.vx + stick.vy * stick.vy);
    if (length > 0.0f) {
        const omni_twist_t ahead = flip_frame(omni_twist_t{stick.vx / length, stick.vy / length, 0.0f});
        const float scale = std::min(limits.speed_m_s, reach(ahead)) / (length > 1.0f ? length : 1.0f);
        stick.vx *= scale;
        stick.vy *= scale;
    }
    stick.wz *= std::min(limits.turn_rad_s, reach({0.0f, 0.0f, 1.0f}));
    omni_setpoint_t setpoint{};
    setpoint.kind = OMNI_SETPOINT_VELOCITY_BODY;
    setpoint.twist = flip_frame(stick);
    accept(setpoint);
}

void Setpoints::on_legacy_line(const LegacySetpoint &line) {
    const char *why = check_position(line.pose);
    why = why != nullptr ? why : check_twist(line.rate);
    if (why != nullptr) {
        refuse(why);
        return;
    }
    omni_setpoint_t setpoint{};
    setpoint.kind = OMNI_SETPOINT_POSE;
    setpoint.pose = line.pose;
    setpoint.twist = line.rate;
    accept(setpoint);
}

/// Duties are open loop: accepted only while armed.
void Setpoints::on_duty(const Frame &frame) {
    const auto message = frame.as<mavlink_omni_setpoint_duty_t>();
    omni_setpoint_t setpoint{};
    setpoint.kind = OMNI_SETPOINT_DUTY;
    if (robot_.state() != OMNI_STATE_ARMED && !robot_.arming()) {
        refuse("duties need an armed robot");
        return;
    }
    for (size_t i = 0; i < OMNI_MAX_WHEELS; ++i) {
        if (!(omni_absf(message.duty[i]) <= 1.0f)) {
            refuse("duty beyond -1..1");
            return;
        }
        setpoint.duty[i] = message.duty[i];
    }
    accept(setpoint);
}

} // namespace omni
