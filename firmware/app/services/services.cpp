// SPDX-License-Identifier: MIT
#include "app/services/services.h"

#include "app/base/flash_code.h"
#include "app/link/mavlink_types.h"

namespace omni {
namespace {

void answer_timesync(Links &links, const RobotClock &clock, const Frame &frame, const Sender &sender) {
    auto message = frame.as<mavlink_timesync_t>();
    if (message.tc1 != 0) {
        return; // an answer to another system
    }
    message.tc1 = static_cast<int64_t>(clock.now_us * 1000);
    links.reply(sender, MAVLINK_MSG_ID_TIMESYNC, message);
}

void answer_ping(Links &links, const Frame &frame, const Sender &sender) {
    auto message = frame.as<mavlink_ping_t>();
    if (message.target_system != 0) {
        return; // an answer
    }
    message.target_system = sender.system;
    message.target_component = sender.component;
    links.reply(sender, MAVLINK_MSG_ID_PING, message);
}

void answer_mission_list(Links &links, const Frame &frame, const Sender &sender) {
    mavlink_mission_count_t message{};
    message.target_system = sender.system;
    message.target_component = sender.component;
    message.mission_type = frame.as<mavlink_mission_request_list_t>().mission_type;
    links.reply(sender, MAVLINK_MSG_ID_MISSION_COUNT, message);
}

/// No file system: an immediate NAK saves the client a dozen retries.
void refuse_file_transfer(Links &links, const Frame &frame, const Sender &sender) {
    constexpr uint8_t opcode_nak = 129;
    constexpr uint8_t error_file_not_found = 10;
    constexpr uint8_t error_unknown_command = 7;
    constexpr uint8_t opcode_open = 4;
    const auto request = frame.as<mavlink_file_transfer_protocol_t>();
    const uint8_t opcode = request.payload[3];
    if (opcode >= 128) {
        return; // an answer
    }
    mavlink_file_transfer_protocol_t message{};
    message.target_system = sender.system;
    message.target_component = sender.component;
    // payload: sequence (2 bytes), session, opcode, size, opcode answered, burst, padding, offset (4), data
    const auto sequence = static_cast<uint16_t>((request.payload[0] | request.payload[1] << 8) + 1);
    message.payload[0] = static_cast<uint8_t>(sequence);
    message.payload[1] = static_cast<uint8_t>(sequence >> 8);
    message.payload[2] = request.payload[2];
    message.payload[3] = opcode_nak;
    message.payload[4] = 1;
    message.payload[5] = opcode;
    message.payload[12] = opcode == opcode_open ? error_file_not_found : error_unknown_command;
    links.reply(sender, MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL, message);
}

/// Missions are not supported. @param mission_type of the request: each type is a separate transaction.
void refuse_mission(Links &links, const Sender &sender, uint8_t mission_type) {
    mavlink_mission_ack_t message{};
    message.target_system = sender.system;
    message.target_component = sender.component;
    message.type = MAV_MISSION_UNSUPPORTED;
    message.mission_type = mission_type;
    links.reply(sender, MAVLINK_MSG_ID_MISSION_ACK, message);
}

template <class Message>
void refuse_mission(Links &links, const Frame &frame, const Sender &sender) {
    refuse_mission(links, sender, frame.as<Message>().mission_type);
}

void refuse_missions(Links &links, const Frame &frame, const Sender &sender) {
    switch (frame.id) {
    case MAVLINK_MSG_ID_MISSION_COUNT:
        refuse_mission<mavlink_mission_count_t>(links, frame, sender);
        break;
    case MAVLINK_MSG_ID_MISSION_ITEM:
        refuse_mission<mavlink_mission_item_t>(links, frame, sender);
        break;
    case MAVLINK_MSG_ID_MISSION_ITEM_INT:
        refuse_mission<mavlink_mission_item_int_t>(links, frame, sender);
        break;
    case MAVLINK_MSG_ID_MISSION_REQUEST:
        refuse_mission<mavlink_mission_request_t>(links, frame, sender);
        break;
    case MAVLINK_MSG_ID_MISSION_REQUEST_INT:
        refuse_mission<mavlink_mission_request_int_t>(links, frame, sender);
        break;
    case MAVLINK_MSG_ID_MISSION_REQUEST_PARTIAL_LIST:
        refuse_mission<mavlink_mission_request_partial_list_t>(links, frame, sender);
        break;
    case MAVLINK_MSG_ID_MISSION_WRITE_PARTIAL_LIST:
        refuse_mission<mavlink_mission_write_partial_list_t>(links, frame, sender);
        break;
    case MAVLINK_MSG_ID_MISSION_CLEAR_ALL:
        refuse_mission<mavlink_mission_clear_all_t>(links, frame, sender);
        break;
    case MAVLINK_MSG_ID_MISSION_SET_CURRENT:
        refuse_mission(links, sender, MAV_MISSION_TYPE_MISSION);
        break;
    default:
        break;
    }
}

/// Requests addressed to this robot. Broadcasts are not refused: all robots on a shared radio would respond at once.
void refuse_politely(Links &links, const Frame &frame, const Sender &sender) {
    if (frame.id == MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL) {
        refuse_file_transfer(links, frame, sender);
    } else {
        refuse_missions(links, frame, sender);
    }
}

} // namespace

OMNI_COLD void serve_small_protocols(Links &links, const RobotClock &clock, const Frame &frame, const Sender &sender) {
    switch (frame.id) {
    case MAVLINK_MSG_ID_TIMESYNC:
        answer_timesync(links, clock, frame, sender);
        break;
    case MAVLINK_MSG_ID_PING:
        answer_ping(links, frame, sender);
        break;
    case MAVLINK_MSG_ID_MISSION_REQUEST_LIST:
        answer_mission_list(links, frame, sender);
        break;
    default:
        if (frame.target_system != 0) {
            refuse_politely(links, frame, sender);
        }
        break;
    }
}

} // namespace omni
