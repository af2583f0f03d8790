// SPDX-License-Identifier: MIT
#include "station.h"

#include <algorithm>
#include <cstdio>
#include <cstring>

#include "check.h"

namespace soak {
namespace {

using fuzz::as;
using fuzz::check;

constexpr uint8_t key[32] = {0x73, 0x6F, 0x61, 0x6B};
constexpr unsigned patience_ms = 1000;

} // namespace

Station::Station(fuzz::Robot &robot, uint64_t signing_time) : robot_(robot), signing_time_(signing_time) {
    robot.listener = this;
}

fuzz::Form Station::form_on(size_t link) const {
    fuzz::Form form;
    form.is_signed = link == radio;
    form.sequence = static_cast<uint8_t>(sequence_);
    return form;
}

void Station::put(size_t link, Bytes frame) {
    if (link == radio) {
        fuzz::sign(&frame, key, ++signing_time_);
    }
    ++sequence_;
    robot_.send(link, frame);
}

void Station::command(size_t link, uint16_t number, float first, float second, float third) {
    check(waiting_ms_ == 0, "one command at a time", number);
    mavlink_command_long_t message{};
    message.command = number;
    message.param1 = first;
    message.param2 = second;
    message.param3 = third;
    message.target_system = 1;
    message.target_component = 1;
    waiting_for_ = number;
    waiting_ms_ = patience_ms;
    send(link, MAVLINK_MSG_ID_COMMAND_LONG, message);
}

void Station::heartbeat(size_t link) {
    mavlink_heartbeat_t message{};
    message.type = MAV_TYPE_GCS;
    message.autopilot = MAV_AUTOPILOT_INVALID;
    send(link, MAVLINK_MSG_ID_HEARTBEAT, message);
}

void Station::set_parameter(size_t link, const char *name, float value) {
    mavlink_param_set_t message{};
    message.param_value = value;
    message.param_type = MAV_PARAM_TYPE_REAL32;
    message.target_system = 1;
    message.target_component = 1;
    std::memcpy(message.param_id, name, std::min(std::strlen(name), sizeof message.param_id));
    send(link, MAVLINK_MSG_ID_PARAM_SET, message);
}

void Station::set_key() {
    mavlink_setup_signing_t message{};
    message.target_system = 1;
    message.target_component = 1;
    std::memcpy(message.secret_key, key, sizeof key);
    message.initial_timestamp = signing_time_;
    send(usb, MAVLINK_MSG_ID_SETUP_SIGNING, message);
}

void Station::list_parameters(size_t link) {
    mavlink_param_request_list_t message{};
    message.target_system = 1;
    message.target_component = 1;
    send(link, MAVLINK_MSG_ID_PARAM_REQUEST_LIST, message);
}

void Station::tick() {
    signing_time_ += 100;
    if (waiting_ms_ > 0) {
        check(--waiting_ms_ > 0, "every command is answered within a second (command)", waiting_for_);
    }
}

void Station::take_text(const Found &frame) {
    const auto message = as<mavlink_statustext_t>(frame);
    ++texts;
    const bool fine = message.severity > MAV_SEVERITY_WARNING || stop_expected_;
    if (!fine) {
        std::printf("the robot says: %.50s\n", message.text);
    }
    check(fine, "a healthy robot warns of nothing (severity)", message.severity);
}

void Station::take_ack(const Found &frame) {
    const auto message = as<mavlink_command_ack_t>(frame);
    if (message.command == waiting_for_ && waiting_ms_ > 0) {
        check(message.result == MAV_RESULT_ACCEPTED, "every command is accepted (command * 10 + result)",
              message.command * 10L + message.result);
        waiting_ms_ = 0;
        ++acknowledged;
    }
}

void Station::heard(size_t port, const Found &frame) {
    ++frames[port];
    switch (frame.id) {
    case MAVLINK_MSG_ID_HEARTBEAT:
        ++heartbeats[port];
        state = as<mavlink_heartbeat_t>(frame).system_status;
        break;
    case MAVLINK_MSG_ID_STATUSTEXT:
        take_text(frame);
        break;
    case MAVLINK_MSG_ID_COMMAND_ACK:
        take_ack(frame);
        break;
    case MAVLINK_MSG_ID_PARAM_VALUE:
        ++parameters;
        break;
    case MAVLINK_MSG_ID_OMNI_STATUS:
        status = as<mavlink_omni_status_t>(frame);
        break;
    case MAVLINK_MSG_ID_OMNI_HEALTH:
        health = as<mavlink_omni_health_t>(frame);
        break;
    case MAVLINK_MSG_ID_OMNI_SIGNING:
        signing_ahead_ms =
            1e-3 *
            static_cast<double>(static_cast<int64_t>(as<mavlink_omni_signing_t>(frame).time - signing_time_ * 10));
        break;
    case MAVLINK_MSG_ID_OMNI_TRACKING:
        tracking = as<mavlink_omni_tracking_t>(frame);
        ++trackings;
        break;
    default:
        break;
    }
}

} // namespace soak
