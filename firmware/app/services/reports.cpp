// SPDX-License-Identifier: MIT
#include "app/services/reports.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <iterator>
#include <limits>

#include "app/base/build_id.h"
#include "app/base/core.h"
#include "app/link/flight_mode.h"
#include "app/link/frames.h"

namespace omni {
namespace {

template <class From>
const From &elements_of(const From &from) {
    return from;
}

std::array<omni_real_t, 3> elements_of(const omni_pose_t &pose) {
    return {pose.x, pose.y, pose.theta};
}

std::array<omni_real_t, 3> elements_of(const omni_twist_t &twist) {
    return {twist.vx, twist.vy, twist.wz};
}

/// Values of an array field of N elements, converted to the field's type.
template <class To, size_t N, class From>
std::array<To, N> array_of(const From &from) {
    const auto &values = elements_of(from);
    static_assert(sizeof values / sizeof *std::begin(values) == N, "the message has another number of elements");
    std::array<To, N> to{};
    std::transform(std::begin(values), std::end(values), to.begin(), [](auto value) { return static_cast<To>(value); });
    return to;
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

/// OMNI_MODE. While disarmed: the mode of the setpoints being received, so that a station sees that they arrive.
uint8_t shown_mode(const ReportSources &sources) {
    const omni_outputs_t &out = sources.robot.latest().outputs;
    return mode_of(out.state == OMNI_STATE_DISARMED ? sources.robot.streamed_kind() : out.setpoint_kind);
}

uint32_t only_if(bool condition, uint32_t bits) {
    return condition ? bits : 0;
}

uint16_t in_millivolts(float volts) {
    return volts > 0.0f ? static_cast<uint16_t>(std::min(volts * 1000.0f + 0.5f, 65534.0f)) : UINT16_MAX;
}

/// Supply current [0.01 A] from the estimated motor currents; regenerative braking is negative. -1: unknown.
int16_t supply_current(const ReportSources &sources) {
    const omni_outputs_t &out = sources.robot.latest().outputs;
    if (!sources.parameters.config().current.enabled || !(out.supply_V > 0.0f)) {
        return -1;
    }
    float watts = 0.0f;
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        watts += out.voltage_V[i] * out.current_A[i];
    }
    const float hundredths = 100.0f * watts / out.supply_V + 0.5f;
    return static_cast<int16_t>(std::max(0.0f, std::min(hundredths, 32767.0f)));
}

uint16_t saturated_count(uint32_t count) {
    return static_cast<uint16_t>(std::min<uint32_t>(count, UINT16_MAX));
}

uint32_t base_mode(const ReportSources &sources) {
    const omni_outputs_t &out = sources.robot.latest().outputs;
    const uint8_t mode = shown_mode(sources);
    const bool guided = mode == OMNI_MODE_POSE || mode == OMNI_MODE_VELOCITY;
    return MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | only_if(out.state == OMNI_STATE_ARMED, MAV_MODE_FLAG_SAFETY_ARMED) |
           only_if(sources.robot.hil(), MAV_MODE_FLAG_HIL_ENABLED) |
           only_if(mode == OMNI_MODE_TRAJECTORY, MAV_MODE_FLAG_AUTO_ENABLED) |
           only_if(guided, MAV_MODE_FLAG_GUIDED_ENABLED);
}

constexpr uint32_t encoders = MAV_SYS_STATUS_SENSOR_ANGULAR_RATE_CONTROL;
constexpr uint32_t motors = MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS;
constexpr uint32_t battery = MAV_SYS_STATUS_SENSOR_BATTERY;
constexpr uint32_t vision = MAV_SYS_STATUS_SENSOR_VISION_POSITION;
constexpr uint32_t no_fence = MAV_SYS_STATUS_GEOFENCE; // MAVProxy announces a breach if an absent fence is not healthy
constexpr uint32_t parts_present = encoders | motors | battery | vision;

uint32_t parts_enabled(const ReportSources &sources) {
    return encoders | motors | only_if(sources.robot.latest().battery_V > 0.0f, battery) |
           only_if(sources.robot.latest().outputs.fixes_accepted > 0, vision);
}

uint32_t parts_healthy(uint32_t faults) {
    return no_fence | only_if((faults & OMNI_FAULT_ENCODER) == 0, encoders) |
           only_if((faults & OMNI_FAULT_DRIVER) == 0, motors) | only_if((faults & OMNI_FAULT_BATTERY) == 0, battery) |
           only_if((faults & OMNI_WARN_POSE_STALE) == 0, vision);
}

MemoryFree memory_free(const ReportSources &sources) {
    return sources.board.memory_free != nullptr ? sources.board.memory_free() : MemoryFree{};
}

/// BATTERY_STATUS has ten cells; ours is one voltage.
std::array<uint16_t, 10> one_cell(uint16_t voltage_mV) {
    std::array<uint16_t, 10> cells{};
    cells.fill(UINT16_MAX);
    cells[0] = voltage_mV;
    return cells;
}

/// `count` is known when this is compiled: GCC 12 loses sight of it under its sanitizers otherwise.
template <uint32_t (Link::*count)() const>
std::array<uint16_t, Board::max_ports> of_each_link(const ReportSources &sources) {
    std::array<uint16_t, Board::max_ports> counts{};
    for (size_t i = 0; i < sources.links.count(); ++i) {
        counts[i] = saturated_count((sources.links[i].*count)());
    }
    return counts;
}

/// 0 if a standard deviation is 0 or not finite.
float correlation_of_xy(const omni_outputs_t &out) {
    const float ratio = out.pose_xy_m2 / (out.pose_sd[0] * out.pose_sd[1]);
    return omni_is_finite(ratio) ? omni_clampf(ratio, -1.0f, 1.0f) : 0.0f;
}

/// Never 0, which MAVLink reads as unsupported: a fix used in this tick has an age of 1 us.
float fix_age_s(const TickReport &latest) {
    constexpr uint64_t most_us = UINT32_MAX;
    if (latest.fix_us == 0) {
        return -1.0f;
    }
    const uint64_t now_us = latest.outputs.time_us;
    const uint64_t age_us = now_us > latest.fix_us ? now_us - latest.fix_us : 1;
    return static_cast<float>(static_cast<uint32_t>(std::min(age_us, most_us))) * 1e-6f;
}

struct Angle {
    omni_real_t sine = 0.0f;
    omni_real_t cosine = 1.0f;
};

Angle half_angle(omni_real_t angle) {
    Angle half;
    omni_sincosf(0.5f * angle, &half.sine, &half.cosine);
    return half;
}

} // namespace

#include "omni/reports_gen.h"

bool report_version(Link &link, const Board &board) {
    mavlink_autopilot_version_t message{};
    message.capabilities = MAV_PROTOCOL_CAPABILITY_MAVLINK2 | MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT |
                           MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST |
                           MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED;
    // Lowest byte: 255 is a release, 0 development.
    message.flight_sw_version = build_id.version | (build_id.changed ? 0u : 255u);
    message.middleware_sw_version = OMNI_PARAM_SCHEMA_VERSION;
    message.os_sw_version = omni_param_schema_crc;
    message.uid = board.serial_number;
    message.board_version = board.wiring_id;
    for (size_t i = 0; i < sizeof message.flight_custom_version; ++i) {
        message.flight_custom_version[i] = static_cast<uint8_t>(build_id.commit >> (56 - 8 * i));
    }
    return link.send(MAVLINK_MSG_ID_AUTOPILOT_VERSION, message, Priority::reply);
}

} // namespace omni
