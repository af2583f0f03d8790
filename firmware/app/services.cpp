// SPDX-License-Identifier: MIT
#include "app/services.h"

namespace omni {
namespace {

void answer_timesync(Shared &shared, const Frame &frame, const Sender &sender) {
    auto message = frame.as<mavlink_timesync_t>();
    if (message.tc1 != 0) {
        return; // an answer to somebody else
    }
    message.tc1 = static_cast<int64_t>(shared.now_us * 1000);
    shared.reply(sender, MAVLINK_MSG_ID_TIMESYNC, message);
}

void answer_ping(Shared &shared, const Frame &frame, const Sender &sender) {
    auto message = frame.as<mavlink_ping_t>();
    if (message.target_system != 0) {
        return; // an answer
    }
    message.target_system = sender.system;
    message.target_component = sender.component;
    shared.reply(sender, MAVLINK_MSG_ID_PING, message);
}

void answer_mission_list(Shared &shared, const Frame &frame, const Sender &sender) {
    mavlink_mission_count_t message{};
    message.target_system = sender.system;
    message.target_component = sender.component;
    message.mission_type = frame.as<mavlink_mission_request_list_t>().mission_type;
    shared.reply(sender, MAVLINK_MSG_ID_MISSION_COUNT, message);
}

/// There are no files: a NAK at once spares the asker a dozen retries.
void refuse_file_transfer(Shared &shared, const Frame &frame, const Sender &sender) {
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
    shared.reply(sender, MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL, message);
}

/// Missions are not spoken. @param mission_type of the request: each list is a conversation of its own.
void refuse_mission(Shared &shared, const Sender &sender, uint8_t mission_type) {
    mavlink_mission_ack_t message{};
    message.target_system = sender.system;
    message.target_component = sender.component;
    message.type = MAV_MISSION_UNSUPPORTED;
    message.mission_type = mission_type;
    shared.reply(sender, MAVLINK_MSG_ID_MISSION_ACK, message);
}

template <class Message>
bool refuse_mission(Shared &shared, const Frame &frame, const Sender &sender) {
    refuse_mission(shared, sender, frame.as<Message>().mission_type);
    return true;
}

bool refuse_missions(Shared &shared, const Frame &frame, const Sender &sender) {
    switch (frame.id) {
    case MAVLINK_MSG_ID_MISSION_COUNT:
        return refuse_mission<mavlink_mission_count_t>(shared, frame, sender);
    case MAVLINK_MSG_ID_MISSION_ITEM:
        return refuse_mission<mavlink_mission_item_t>(shared, frame, sender);
    case MAVLINK_MSG_ID_MISSION_ITEM_INT:
        return refuse_mission<mavlink_mission_item_int_t>(shared, frame, sender);
    case MAVLINK_MSG_ID_MISSION_REQUEST:
        return refuse_mission<mavlink_mission_request_t>(shared, frame, sender);
    case MAVLINK_MSG_ID_MISSION_REQUEST_INT:
        return refuse_mission<mavlink_mission_request_int_t>(shared, frame, sender);
    case MAVLINK_MSG_ID_MISSION_REQUEST_PARTIAL_LIST:
        return refuse_mission<mavlink_mission_request_partial_list_t>(shared, frame, sender);
    case MAVLINK_MSG_ID_MISSION_WRITE_PARTIAL_LIST:
        return refuse_mission<mavlink_mission_write_partial_list_t>(shared, frame, sender);
    case MAVLINK_MSG_ID_MISSION_CLEAR_ALL:
        return refuse_mission<mavlink_mission_clear_all_t>(shared, frame, sender);
    case MAVLINK_MSG_ID_MISSION_SET_CURRENT:
        refuse_mission(shared, sender, MAV_MISSION_TYPE_MISSION);
        return true;
    default:
        return false;
    }
}

/// There are no logs on the robot: an empty list, an end at once.
bool refuse_logs(Shared &shared, const Frame &frame, const Sender &sender) {
    switch (frame.id) {
    case MAVLINK_MSG_ID_LOG_REQUEST_LIST:
        shared.reply(sender, MAVLINK_MSG_ID_LOG_ENTRY, mavlink_log_entry_t{});
        return true;
    case MAVLINK_MSG_ID_LOG_REQUEST_DATA: {
        const auto request = frame.as<mavlink_log_request_data_t>();
        mavlink_log_data_t message{};
        message.id = request.id;
        message.ofs = request.ofs;
        shared.reply(sender, MAVLINK_MSG_ID_LOG_DATA, message);
        return true;
    }
    case MAVLINK_MSG_ID_LOG_ERASE:
        shared.refuse(MAV_SEVERITY_NOTICE, Text().add("there are no logs to erase"));
        return true;
    default:
        return false;
    }
}

/// What a station asks of this very robot. To everybody nobody says no: a fleet would answer in chorus.
bool refuse_politely(Shared &shared, const Frame &frame, const Sender &sender) {
    if (frame.id == MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL) {
        refuse_file_transfer(shared, frame, sender);
        return true;
    }
    return refuse_missions(shared, frame, sender) || refuse_logs(shared, frame, sender);
}

} // namespace

bool serve_small_protocols(Shared &shared, const Frame &frame, const Sender &sender) {
    switch (frame.id) {
    case MAVLINK_MSG_ID_TIMESYNC:
        answer_timesync(shared, frame, sender);
        return true;
    case MAVLINK_MSG_ID_PING:
        answer_ping(shared, frame, sender);
        return true;
    case MAVLINK_MSG_ID_MISSION_REQUEST_LIST:
        answer_mission_list(shared, frame, sender);
        return true;
    default:
        return frame.target_system != 0 && refuse_politely(shared, frame, sender);
    }
}

} // namespace omni
