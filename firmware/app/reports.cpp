// SPDX-License-Identifier: MIT
#include "app/reports.h"

#include <algorithm>
#include <cstring>
#include <limits>

#include "app/core.h"
#include "app/frames.h"
#include "omni/version_gen.h"

namespace omni {
namespace {

template <size_t N>
void copy(float (&to)[N], const omni_real_t *from) {
    std::copy(from, from + N, to);
}

void copy_pose(float (&to)[3], const omni_pose_t &pose) {
    to[0] = pose.x;
    to[1] = pose.y;
    to[2] = pose.theta;
}

void copy_twist(float (&to)[3], const omni_twist_t &twist) {
    to[0] = twist.vx;
    to[1] = twist.vy;
    to[2] = twist.wz;
}

uint8_t system_status(uint8_t state) {
    switch (state) {
    case OMNI_STATE_ARMED:
        return MAV_STATE_ACTIVE;
    case OMNI_STATE_FAILSAFE:
        return MAV_STATE_CRITICAL;
    case OMNI_STATE_ESTOP:
        return MAV_STATE_EMERGENCY;
    case OMNI_STATE_INIT:
        return MAV_STATE_BOOT;
    default:
        return MAV_STATE_STANDBY;
    }
}

uint8_t mode_of(uint8_t setpoint_kind) {
    switch (setpoint_kind) {
    case OMNI_SETPOINT_POSE:
        return OMNI_MODE_POSE;
    case OMNI_SETPOINT_VELOCITY_BODY:
    case OMNI_SETPOINT_VELOCITY_WORLD:
        return OMNI_MODE_VELOCITY;
    case OMNI_SETPOINT_TRAJECTORY:
        return OMNI_MODE_TRAJECTORY;
    case OMNI_SETPOINT_DUTY:
        return OMNI_MODE_DUTY;
    default:
        return OMNI_MODE_HOLD;
    }
}

uint32_t only_if(bool condition, uint32_t bits) {
    return condition ? bits : 0;
}

uint16_t millivolts(float volts) {
    return volts > 0.0f ? static_cast<uint16_t>(std::min(volts * 1000.0f + 0.5f, 65534.0f)) : UINT16_MAX;
}

uint16_t saturated(uint32_t count) {
    return static_cast<uint16_t>(std::min<uint32_t>(count, UINT16_MAX));
}

} // namespace

bool report_heartbeat(const Shared &shared, Link &link, Priority, bool) {
    const omni_outputs_t &out = shared.latest.outputs;
    mavlink_heartbeat_t message{};
    message.type = MAV_TYPE_GROUND_ROVER;
    message.autopilot = MAV_AUTOPILOT_GENERIC;
    const uint8_t mode = mode_of(out.setpoint_kind);
    const bool guided = mode == OMNI_MODE_POSE || mode == OMNI_MODE_VELOCITY;
    const uint32_t flags =
        MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | only_if(out.state == OMNI_STATE_ARMED, MAV_MODE_FLAG_SAFETY_ARMED) |
        only_if(shared.hil, MAV_MODE_FLAG_HIL_ENABLED) | only_if(mode == OMNI_MODE_TRAJECTORY, MAV_MODE_FLAG_AUTO_ENABLED) |
        only_if(guided, MAV_MODE_FLAG_GUIDED_ENABLED);
    message.base_mode = static_cast<uint8_t>(flags);
    message.custom_mode = mode;
    message.system_status = system_status(out.state);
    message.mavlink_version = 3;
    return link.send(MAVLINK_MSG_ID_HEARTBEAT, message, Priority::reply);
}

bool report_sys_status(const Shared &shared, Link &link, Priority priority, bool) {
    const uint32_t faults = shared.latest.outputs.faults;
    const uint32_t encoders = MAV_SYS_STATUS_SENSOR_ANGULAR_RATE_CONTROL;
    const uint32_t motors = MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS;
    const uint32_t battery = MAV_SYS_STATUS_SENSOR_BATTERY;
    const uint32_t pose = MAV_SYS_STATUS_SENSOR_VISION_POSITION;
    const uint32_t no_fence = MAV_SYS_STATUS_GEOFENCE; // MAVProxy announces a breach if an absent fence is not healthy
    mavlink_sys_status_t message{};
    message.onboard_control_sensors_present = encoders | motors | battery | pose;
    message.onboard_control_sensors_enabled = encoders | motors | only_if(shared.latest.battery_V > 0.0f, battery) |
                                              only_if(shared.latest.outputs.fixes_accepted > 0, pose);
    message.onboard_control_sensors_health =
        no_fence | only_if((faults & OMNI_FAULT_ENCODER) == 0, encoders) | only_if((faults & OMNI_FAULT_DRIVER) == 0, motors) |
        only_if((faults & OMNI_FAULT_BATTERY) == 0, battery) | only_if((faults & OMNI_WARN_POSE_STALE) == 0, pose);
    message.voltage_battery = millivolts(shared.latest.battery_V);
    message.current_battery = -1;
    message.battery_remaining = -1;
    message.errors_count1 = saturated(shared.latest.i2c_errors);
    message.errors_comm = saturated(link.rx_errors());
    return link.send(MAVLINK_MSG_ID_SYS_STATUS, message, priority);
}

/// Times of ticks are measured, so a stream of them would make two runs of the same simulation differ: in host-in-the-loop
/// they are told when asked for only.
bool report_omni_status(const Shared &shared, Link &link, Priority priority, bool asked) {
    const TickReport &latest = shared.latest;
    const bool measured = asked || !shared.hil;
    mavlink_omni_status_t message{};
    message.time_boot_ms = shared.now_ms();
    message.ticks = latest.ticks;
    message.faults = latest.outputs.faults;
    message.fault_history = latest.outputs.fault_history;
    message.overruns = latest.overruns;
    message.i2c_errors = latest.i2c_errors;
    message.rx_errors = link.rx_errors();
    message.tx_dropped = link.tx_dropped();
    message.tick_us_mean = measured ? latest.tick_us_mean : 0.0f;
    message.tick_us_max = measured ? latest.tick_us_max : 0.0f;
    message.state = latest.outputs.state;
    message.hil = shared.hil ? 1 : 0;
    return link.send(MAVLINK_MSG_ID_OMNI_STATUS, message, priority);
}

/// What is measured in real time and memory stays at zero in a stream of host-in-the-loop, as in OMNI_STATUS.
bool report_health(const Shared &shared, Link &link, Priority priority, bool asked) {
    const TickReport &latest = shared.latest;
    const bool measured = asked || !shared.hil;
    const MemoryFree memory = measured && shared.board.memory_free != nullptr ? shared.board.memory_free() : MemoryFree{};
    mavlink_omni_health_t message{};
    message.time_boot_ms = shared.now_ms();
    std::copy(latest.encoder_errors, latest.encoder_errors + OMNI_MAX_WHEELS, message.encoder_errors);
    message.i2c_nacks = latest.i2c.nacks;
    message.i2c_timeouts = latest.i2c.timeouts;
    message.i2c_recoveries = latest.i2c.recoveries;
    message.i2c_us = latest.i2c.last_us;
    message.signing_refused = shared.signing.counts().total();
    message.stack_free = memory.stack;
    message.heap_free = memory.heap;
    message.tick_jitter_us_max = latest.tick_jitter_us_max;
    for (size_t i = 0; i < shared.board.port_count; ++i) {
        message.link_rx_errors[i] = saturated(shared.links[i].rx_errors());
        message.link_tx_dropped[i] = saturated(shared.links[i].tx_dropped());
    }
    message.reset_cause = static_cast<uint8_t>(shared.board.watchdog->reset_cause());
    return link.send(MAVLINK_MSG_ID_OMNI_HEALTH, message, priority);
}

bool report_local_position(const Shared &shared, Link &link, Priority priority, bool) {
    const omni_pose_t pose = flip_frame(shared.latest.outputs.pose);
    const omni_twist_t rate = flip_frame(shared.latest.outputs.rate);
    mavlink_local_position_ned_t message{};
    message.time_boot_ms = shared.now_ms();
    message.x = pose.x;
    message.y = pose.y;
    message.vx = rate.vx;
    message.vy = rate.vy;
    return link.send(MAVLINK_MSG_ID_LOCAL_POSITION_NED, message, priority);
}

bool report_tracking(const Shared &shared, Link &link, Priority priority, bool) {
    const omni_outputs_t &out = shared.latest.outputs;
    mavlink_omni_tracking_t message{};
    message.time_boot_ms = shared.now_ms();
    copy_pose(message.reference, out.reference.pose);
    copy_twist(message.reference_rate, out.reference.rate);
    copy_pose(message.pose, out.pose);
    copy(message.pose_sd, out.pose_sd);
    message.path_time = out.reference.path_time_s;
    message.phase = static_cast<uint8_t>(out.reference.phase);
    return link.send(MAVLINK_MSG_ID_OMNI_TRACKING, message, priority);
}

bool report_attitude(const Shared &shared, Link &link, Priority priority, bool) {
    mavlink_attitude_t message{};
    message.time_boot_ms = shared.now_ms();
    message.yaw = flip_frame(shared.latest.outputs.pose).theta;
    message.yawspeed = flip_frame(shared.latest.outputs.rate).wz;
    return link.send(MAVLINK_MSG_ID_ATTITUDE, message, priority);
}

bool report_wheels(const Shared &shared, Link &link, Priority priority, bool) {
    const omni_outputs_t &out = shared.latest.outputs;
    mavlink_omni_wheels_t message{};
    message.time_boot_ms = shared.now_ms();
    copy(message.speed, out.wheel_rad_s);
    copy(message.reference, out.wheel_reference);
    copy(message.duty, out.duty);
    copy(message.current, out.current_A);
    copy(message.slip, out.slip_m_s);
    message.wheel_scale = out.wheel_scale;
    message.duty_scale = out.duty_scale;
    return link.send(MAVLINK_MSG_ID_OMNI_WHEELS, message, priority);
}

bool report_control(const Shared &shared, Link &link, Priority priority, bool) {
    const omni_outputs_t &out = shared.latest.outputs;
    mavlink_omni_control_t message{};
    message.time_boot_ms = shared.now_ms();
    copy(message.error, out.terms.error);
    copy(message.integral, out.terms.integral);
    copy(message.surface, out.terms.surface);
    copy(message.equivalent, out.terms.equivalent);
    copy(message.switching, out.terms.switching);
    copy(message.ismc_margin, out.ismc_margin);
    message.nis = out.nis;
    message.fixes_accepted = out.fixes_accepted;
    message.fixes_refused = out.fixes_refused;
    message.config_sequence = out.config_sequence;
    message.controller = out.controller;
    return link.send(MAVLINK_MSG_ID_OMNI_CONTROL, message, priority);
}

bool report_sample(const Shared &shared, Link &link, Priority priority, bool) {
    const omni_outputs_t &out = shared.latest.outputs;
    mavlink_omni_sample_t message{};
    message.time_us = out.time_us;
    std::memcpy(message.counts, shared.latest.counts, sizeof message.counts);
    std::memcpy(message.volt_seconds, shared.latest.volt_us, sizeof message.volt_seconds);
    message.supply = out.supply_V;
    copy_pose(message.pose, out.pose);
    message.phase = static_cast<uint8_t>(out.reference.phase);
    return link.send(MAVLINK_MSG_ID_OMNI_SAMPLE, message, priority);
}

bool report_battery(const Shared &shared, Link &link, Priority priority, bool) {
    mavlink_battery_status_t message{};
    message.current_consumed = -1;
    message.energy_consumed = -1;
    message.temperature = INT16_MAX;
    std::memset(message.voltages, 0xFF, sizeof message.voltages);
    message.voltages[0] = millivolts(shared.latest.battery_V);
    message.current_battery = -1;
    message.battery_remaining = -1;
    return link.send(MAVLINK_MSG_ID_BATTERY_STATUS, message, priority);
}

bool report_position_target(const Shared &shared, Link &link, Priority priority, bool) {
    const omni_reference_t &reference = shared.latest.outputs.reference;
    const omni_pose_t pose = flip_frame(reference.pose);
    const omni_twist_t rate = flip_frame(reference.rate);
    const omni_twist_t acceleration = flip_frame(reference.acceleration);
    mavlink_position_target_local_ned_t message{};
    message.time_boot_ms = shared.now_ms();
    message.x = pose.x;
    message.y = pose.y;
    message.vx = rate.vx;
    message.vy = rate.vy;
    message.afx = acceleration.vx;
    message.afy = acceleration.vy;
    message.yaw = pose.theta;
    message.yaw_rate = rate.wz;
    message.coordinate_frame = MAV_FRAME_LOCAL_NED;
    return link.send(MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED, message, priority);
}

bool report_odometry(const Shared &shared, Link &link, Priority priority, bool) {
    const omni_outputs_t &out = shared.latest.outputs;
    const omni_pose_t pose = flip_frame(out.pose);
    const omni_twist_t body = flip_frame(omni_twist_to_body(&out.rate, out.pose.theta));
    omni_real_t sine = 0.0f;
    omni_real_t cosine = 1.0f;
    omni_sincosf(0.5f * pose.theta, &sine, &cosine);
    mavlink_odometry_t message{};
    message.time_usec = shared.now_us;
    message.frame_id = MAV_FRAME_LOCAL_NED;
    message.child_frame_id = MAV_FRAME_BODY_FRD;
    message.x = pose.x;
    message.y = pose.y;
    message.q[0] = cosine;
    message.q[3] = sine;
    message.vx = body.vx;
    message.vy = body.vy;
    message.yawspeed = body.wz;
    // Row-major upper triangle of 6 x 6: x, y and yaw are elements 0, 6 and 20.
    message.pose_covariance[0] = out.pose_sd[0] * out.pose_sd[0];
    message.pose_covariance[6] = out.pose_sd[1] * out.pose_sd[1];
    message.pose_covariance[20] = out.pose_sd[2] * out.pose_sd[2];
    message.velocity_covariance[0] = std::numeric_limits<float>::quiet_NaN();
    message.estimator_type = MAV_ESTIMATOR_TYPE_VISION;
    return link.send(MAVLINK_MSG_ID_ODOMETRY, message, priority);
}

bool report_signing(const Shared &shared, Link &link, Priority priority, bool) {
    const SigningCounts &counts = shared.signing.counts();
    mavlink_omni_signing_t message{};
    message.time = shared.signing.time() * 10;
    message.time_boot_ms = shared.now_ms();
    message.fingerprint = shared.signing.fingerprint();
    message.refused_unsigned = counts.not_signed;
    message.refused_wrong = counts.wrong;
    message.refused_replayed = counts.replayed + counts.ahead;
    message.refused_keys = counts.keys;
    message.refused_lines = shared.legacy_line.refused();
    message.state = static_cast<uint8_t>(shared.signing.state());
    return link.send(MAVLINK_MSG_ID_OMNI_SIGNING, message, priority);
}

bool report_version(const Shared &, Link &link, Priority priority, bool) {
    mavlink_autopilot_version_t message{};
    message.capabilities = MAV_PROTOCOL_CAPABILITY_MAVLINK2 | MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT |
                           MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST | MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED;
    // Lowest byte: 255 is a release, 0 development.
    message.flight_sw_version = static_cast<uint32_t>(OMNI_VERSION_MAJOR) << 24 |
                                static_cast<uint32_t>(OMNI_VERSION_MINOR) << 16 |
                                static_cast<uint32_t>(OMNI_VERSION_PATCH) << 8 | (OMNI_GIT_DIRTY != 0 ? 0u : 255u);
    message.middleware_sw_version = OMNI_PARAM_SCHEMA_VERSION;
    message.os_sw_version = omni_param_schema_crc;
    const uint64_t hash = OMNI_GIT_HASH;
    for (size_t i = 0; i < sizeof message.flight_custom_version; ++i) {
        message.flight_custom_version[i] = static_cast<uint8_t>(hash >> (56 - 8 * i));
    }
    return link.send(MAVLINK_MSG_ID_AUTOPILOT_VERSION, message, priority);
}

} // namespace omni
