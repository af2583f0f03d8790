// SPDX-License-Identifier: MIT
// What a sequence says and does beside stops.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "app/base/core.h"
#include "generator.h"
#include "messages.h"
#include "sequence.h"

namespace fuzz {
namespace {

constexpr size_t most_random_bytes = 400;

/// Bytes that an action's own eight stand for.
Bytes random_bytes(const Action &action, size_t count) {
    uint64_t seed = 0;
    std::memcpy(&seed, &action, sizeof seed);
    Generator random(seed);
    Bytes bytes(count);
    std::generate(bytes.begin(), bytes.end(), [&random] { return static_cast<uint8_t>(random.next() >> 56); });
    return bytes;
}

float share(int16_t x) {
    return static_cast<float>(x) / 32768.0f;
}

} // namespace

void Sequence::drive(const Action &action) {
    const Form form = form_on(link_of(action));
    if (action.a % 4 == 0) {
        mavlink_set_position_target_local_ned_t target{};
        target.coordinate_frame = MAV_FRAME_BODY_FRD;
        target.type_mask = 0x5C7; // velocity and yaw rate only
        target.vx = share(action.x);
        send(action, frame_of(MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED, target, form));
    } else if (action.a % 4 == 1) {
        mavlink_omni_setpoint_duty_t duty{};
        std::fill(duty.duty, duty.duty + OMNI_MAX_WHEELS, share(action.x));
        send(action, frame_of(MAVLINK_MSG_ID_OMNI_SETPOINT_DUTY, duty, form));
    } else if (action.a % 4 == 2) {
        mavlink_manual_control_t stick{};
        stick.x = static_cast<int16_t>(share(action.x) * 1000.0f);
        send(action, frame_of(MAVLINK_MSG_ID_MANUAL_CONTROL, stick, form));
    } else {
        mavlink_set_position_target_local_ned_t target{};
        target.coordinate_frame = MAV_FRAME_LOCAL_NED;
        target.type_mask = 0x5F8; // position only
        target.x = share(action.x);
        send(action, frame_of(MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED, target, form));
    }
}

void Sequence::fixes(const Action &action) {
    const size_t link = link_of(action);
    const int count = action.n % 80;
    Action one = action;
    for (int i = 0; i <= count; ++i) {
        mavlink_omni_pose_fix_t fix{};
        fix.time_boot_ms = action.b;
        fix.x_mm = static_cast<int16_t>(i + (action.x & 0xFF));
        one.link = static_cast<uint8_t>(link | (i < count ? 0x80 : action.link & 0x80)); // a backlog comes in one piece
        send(one, frame_of(MAVLINK_MSG_ID_OMNI_POSE_FIX, fix, form_on(link)));
    }
}

void Sequence::heartbeat(const Action &action) {
    mavlink_heartbeat_t beat{};
    beat.type = MAV_TYPE_GCS;
    beat.autopilot = MAV_AUTOPILOT_INVALID;
    send(action, frame_of(MAVLINK_MSG_ID_HEARTBEAT, beat, form_on(link_of(action))));
}

void Sequence::parameter(const Action &action) {
    const omni_param_info_t &info = omni_param_table[parameter_for(action.n)];
    const float between = info.minimum + (info.maximum - info.minimum) * static_cast<float>(action.b) / 255.0f;
    const float values[] = {info.minimum, info.maximum, info.initial, between, std::floor(between), share(action.x)};
    mavlink_param_set_t message{};
    message.param_value = values[action.a % 6];
    message.param_type = MAV_PARAM_TYPE_REAL32;
    std::memcpy(message.param_id, info.name, strnlen(info.name, sizeof message.param_id));
    send(action, frame_of(MAVLINK_MSG_ID_PARAM_SET, message, form_on(link_of(action))));
}

void Sequence::trajectory(const Action &action) {
    if (action.a % 3 == 0) {
        command(action, MAV_CMD_OMNI_TRAJECTORY_START, static_cast<float>(action.b % 8), 1.0f);
    } else if (action.a % 3 == 1) {
        command(action, MAV_CMD_OMNI_TRAJECTORY_STOP, 0.0f, 0.0f);
    } else {
        command(action, MAV_CMD_OMNI_WAYPOINT, static_cast<float>(action.b % 4), share(action.x));
    }
}

/// Any message of the dialect with any fields but a request to arm and another key.
void Sequence::message(const Action &action) {
    const size_t link = link_of(action);
    const Bytes bytes = random_bytes(action, most_random_bytes);
    Script script(bytes.data(), bytes.size());
    const Manners manners;
    const mavlink_msg_entry_t &entry = pick_message(script, manners);
    if (entry.msgid == MAVLINK_MSG_ID_SETUP_SIGNING) {
        return;
    }
    uint8_t payload[256] = {};
    fill_payload(payload, entry, script, manners);
    Bytes frame;
    append_frame(&frame, entry, payload, form_on(link));
    const bool is_command = entry.msgid == MAVLINK_MSG_ID_COMMAND_LONG || entry.msgid == MAVLINK_MSG_ID_COMMAND_INT;
    mavlink_command_long_t said{};
    std::memcpy(&said, payload, sizeof said);
    const bool releases = is_command && said.command == MAV_CMD_OMNI_ESTOP && said.param1 == 0.0f;
    if (releases && dirty_[link]) {
        return;
    }
    send(action, frame, releases ? Event::release : Event::nothing);
}

void Sequence::noise(const Action &action) {
    const size_t link = link_of(action);
    Bytes bytes = random_bytes(action, 1 + action.n % 24);
    if ((action.a & 1) != 0) {
        bytes[0] = (action.a & 2) != 0 ? 0xFE : 0xFD; // as a frame begins
    }
    dirty_[link] = dirty_[link] || std::any_of(bytes.begin(), bytes.end(), [](uint8_t byte) { return byte >= 0xFD; });
    put(link, bytes);
    background();
}

void Sequence::half(const Action &action) {
    const size_t link = link_of(action);
    mavlink_vicon_position_estimate_t message{}; // long: a stop behind its beginning lies within what it claims
    message.x = share(action.x);
    std::fill(message.covariance, message.covariance + 21, 1.0f);
    Bytes frame = frame_of(MAVLINK_MSG_ID_VICON_POSITION_ESTIMATE, message);
    frame.resize(1 + action.n % (frame.size() - 1));
    dirty_[link] = true;
    put(link, frame);
    background();
}

void Sequence::bus(const Action &action) {
    robot_.bus.fate = action.a % 2 == 0 ? omni::I2cStatus::done : static_cast<omni::I2cStatus>(1 + action.b % 4);
}

/// Ahead only: a robot's clock never goes back.
void Sequence::clock_jump(const Action &action) {
    const uint64_t by = (action.a & 1) != 0 ? uint64_t{action.n} << 20 : action.n;
    robot_.clock.us += by;
    robot_.clock.ns += by * 1000;
    robot_.hil_us += by;
    signing_time_ += by / 10;
}

void Sequence::silence(const Action &) {
    constexpr uint64_t span_us = 300'000;
    robot_.clock.us += span_us;
    robot_.clock.ns += span_us * 1000;
    signing_time_ += span_us / 10;
    background();
}

void Sequence::storage(const Action &action) {
    if (action.b % 8 == 0) {
        robot_.storage.writes_left = action.n % 2048;
        storage_works_ = false;
    }
    command(action, MAV_CMD_PREFLIGHT_STORAGE, static_cast<float>(action.a % 3), 0.0f);
}

/// From now on everything said over the radio is signed, whether the robot took the key or not.
void Sequence::key(const Action &action) {
    mavlink_setup_signing_t message{};
    message.target_system = 1;
    message.target_component = 1;
    const uint8_t begin[] = {0x4B, 0x45, 0x59};
    std::memcpy(message.secret_key, begin, sizeof begin);
    message.initial_timestamp = signing_time_;
    Action over_usb = action;
    over_usb.link = 0;
    if (robot_.ports[0].connection == 0 || dirty_[0] || !joined_[radio].empty() || !robot_.ports[radio].in.empty()) {
        return;
    }
    tick_once(0); // a robot sees its clock a thousand times a second: no jump falls together with a new key
    signs_ = true;
    send(over_usb, frame_of(MAVLINK_MSG_ID_SETUP_SIGNING, message));
}

void Sequence::scan(const Action &action) {
    if (action.a % 2 == 0) {
        command(action, MAV_CMD_OMNI_I2C_SCAN, 0.0f, 0.0f);
    } else {
        command(action, MAV_CMD_OMNI_OE_TEST, 0.1f + std::fabs(share(action.x)), static_cast<float>(action.b & 1));
    }
}

/// What makes a robot talk.
void Sequence::list(const Action &action) {
    const Form form = form_on(link_of(action));
    if (action.a % 3 == 0) {
        send(action, frame_of(MAVLINK_MSG_ID_PARAM_REQUEST_LIST, mavlink_param_request_list_t{}, form));
    } else if (action.a % 3 == 1) {
        command(action, MAV_CMD_SET_MESSAGE_INTERVAL, static_cast<float>(action.n), 1000.0f);
    } else {
        mavlink_request_data_stream_t stream{};
        stream.req_message_rate = action.n;
        stream.start_stop = 1;
        send(action, frame_of(MAVLINK_MSG_ID_REQUEST_DATA_STREAM, stream, form));
    }
}

} // namespace fuzz
