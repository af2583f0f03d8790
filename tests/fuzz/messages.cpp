// SPDX-License-Identifier: MIT
#include "messages.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>

#include "app/base/core.h"

namespace fuzz {
namespace {

constexpr uint32_t listened_to[] = {
    MAVLINK_MSG_ID_COMMAND_LONG,
    MAVLINK_MSG_ID_PARAM_SET,
    MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED,
    MAVLINK_MSG_ID_OMNI_SETPOINT_DUTY,
    MAVLINK_MSG_ID_HEARTBEAT,
    MAVLINK_MSG_ID_COMMAND_INT,
    MAVLINK_MSG_ID_VICON_POSITION_ESTIMATE,
    MAVLINK_MSG_ID_ATT_POS_MOCAP,
    MAVLINK_MSG_ID_PARAM_REQUEST_READ,
    MAVLINK_MSG_ID_PARAM_REQUEST_LIST,
    MAVLINK_MSG_ID_REQUEST_DATA_STREAM,
    MAVLINK_MSG_ID_TIMESYNC,
    MAVLINK_MSG_ID_PING,
    MAVLINK_MSG_ID_MISSION_REQUEST_LIST,
    MAVLINK_MSG_ID_FILE_TRANSFER_PROTOCOL,
    MAVLINK_MSG_ID_MISSION_COUNT,
    MAVLINK_MSG_ID_MISSION_ITEM,
    MAVLINK_MSG_ID_MISSION_ITEM_INT,
    MAVLINK_MSG_ID_MISSION_REQUEST,
    MAVLINK_MSG_ID_MISSION_REQUEST_INT,
    MAVLINK_MSG_ID_MISSION_REQUEST_PARTIAL_LIST,
    MAVLINK_MSG_ID_MISSION_WRITE_PARTIAL_LIST,
    MAVLINK_MSG_ID_MISSION_SET_CURRENT,
    MAVLINK_MSG_ID_MISSION_CLEAR_ALL,
    MAVLINK_MSG_ID_LOG_REQUEST_LIST,
    MAVLINK_MSG_ID_LOG_REQUEST_DATA,
    MAVLINK_MSG_ID_LOG_ERASE,
    MAVLINK_MSG_ID_LOG_REQUEST_END,
    // From here on whole numbers move the robot: no nonsense.
    MAVLINK_MSG_ID_OMNI_HIL_SENSORS,
    MAVLINK_MSG_ID_MANUAL_CONTROL,
    MAVLINK_MSG_ID_OMNI_POSE_FIX,
    MAVLINK_MSG_ID_SET_MODE,
};
constexpr size_t without_whole_numbers = 28;

constexpr uint16_t commands[] = {
    MAV_CMD_COMPONENT_ARM_DISARM,
    MAV_CMD_OMNI_TRAJECTORY_START,
    MAV_CMD_OMNI_WAYPOINT,
    MAV_CMD_OMNI_ESTOP,
    MAV_CMD_DO_SET_MODE,
    MAV_CMD_SET_MESSAGE_INTERVAL,
    MAV_CMD_REQUEST_MESSAGE,
    MAV_CMD_PREFLIGHT_STORAGE,
    MAV_CMD_OMNI_TRAJECTORY_STOP,
    MAV_CMD_OMNI_SET_POSE,
    MAV_CMD_OMNI_HIL,
    MAV_CMD_DO_FLIGHTTERMINATION,
    MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES,
    MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN,
    MAV_CMD_OMNI_BURST,
    MAV_CMD_OMNI_EXCITE,
    MAV_CMD_OMNI_TRIAL,
};

constexpr float nan = std::numeric_limits<float>::quiet_NaN();
constexpr float inf = std::numeric_limits<float>::infinity();
constexpr float nonsense[] = {nan, inf, -inf, -nan};
constexpr float special[] = {0.0f,        1.0f,        -1.0f,  2.0f,    3.0f,     4.0f,   0.5f,     0.1f,
                             -0.1f,       1e-3f,       5.0f,   1e-40f,  -0.0f,    1e4f,   20000.0f, 21196.0f,
                             16777215.0f, 16777216.0f, 4.0e9f, 3.4e38f, -3.4e38f, 2.1e9f, 60110.0f, 60118.0f,
                             nan,         inf,         -inf,   1000.0f, 999.0f,   32.0f};

float pick_float(Script &script, bool only_nonsense) {
    if (only_nonsense) {
        return nonsense[script.below(std::size(nonsense))];
    }
    switch (script.below(4)) {
    case 0:
        return script.number<float>();
    case 1:
        return static_cast<float>(script.number<int8_t>()) * 0.01f;
    default:
        return special[script.below(std::size(special))];
    }
}

template <class Number>
void put(uint8_t *payload, size_t offset, Number value) {
    std::memcpy(payload + offset, &value, sizeof value);
}

/// Field by field, each of its own type.
void fill_fields(uint8_t *payload, uint32_t id, Script &script, bool only_nonsense) {
    const mavlink_message_info_t *info = mavlink_get_message_info_by_id(id);
    for (unsigned i = 0; info != nullptr && i < info->num_fields; ++i) {
        const mavlink_field_info_t &field = info->fields[i];
        const unsigned count = std::max(field.array_length, 1u);
        if (field.type == MAVLINK_TYPE_FLOAT) {
            for (unsigned k = 0; k < count; ++k) {
                put(payload, field.wire_offset + 4 * k, pick_float(script, only_nonsense));
            }
        } else {
            constexpr unsigned sizes[] = {1, 1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
            const unsigned size = sizes[field.type];
            // Mostly small numbers: the others are a dead end in most messages.
            const unsigned filled = script.one_in(4) ? size * count : 1;
            std::memset(payload + field.wire_offset, 0, size_t{size} * count);
            script.bytes(payload + field.wire_offset, filled);
        }
    }
}

void fill_param_set(uint8_t *payload, Script &script, bool only_nonsense) {
    mavlink_param_set_t message{};
    const omni_param_info_t &info = omni_param_table[parameter_for(script.number<uint16_t>())];
    const float share = static_cast<float>(script.byte()) / 255.0f;
    const float values[] = {info.minimum + share * (info.maximum - info.minimum),
                            std::floor(info.minimum + share * (info.maximum - info.minimum)),
                            info.minimum,
                            info.maximum,
                            info.initial,
                            std::nextafter(info.maximum, inf),
                            pick_float(script, false)};
    message.param_value = only_nonsense ? pick_float(script, true) : values[script.below(std::size(values))];
    std::memcpy(message.param_id, info.name, strnlen(info.name, sizeof message.param_id));
    if (script.one_in(8)) {
        message.param_id[script.below(sizeof message.param_id)] = static_cast<char>(script.byte());
    }
    message.param_type = script.one_in(8) ? script.byte() : static_cast<uint8_t>(MAV_PARAM_TYPE_REAL32);
    std::memcpy(payload, &message, sizeof message);
}

/// COMMAND_LONG and COMMAND_INT both begin with four parameters.
void fill_command(uint8_t *payload, Script &script, const Manners &manners) {
    constexpr size_t at_number = offsetof(mavlink_command_long_t, command);
    static_assert(at_number == offsetof(mavlink_command_int_t, command), "the number stands at the same place");
    constexpr uint16_t first_of_ours = 60110;
    uint16_t command = commands[script.entry(std::size(commands), [](size_t i) { return commands[i]; })];
    if (script.one_in(8)) {
        command =
            script.one_in(4) ? script.number<uint16_t>() : static_cast<uint16_t>(first_of_ours + script.below(20));
    }
    put(payload, at_number, command);
    if (command == MAV_CMD_COMPONENT_ARM_DISARM && !manners.may_arm) {
        float first = 0.0f;
        std::memcpy(&first, payload, sizeof first);
        put(payload, 0, first == 1.0f ? std::nextafter(1.0f, 2.0f) : first);
    }
}

void address(uint8_t *payload, const mavlink_msg_entry_t &entry, Script &script) {
    const bool elsewhere = script.one_in(16);
    if ((entry.flags & MAV_MSG_ENTRY_FLAG_HAVE_TARGET_SYSTEM) != 0) {
        payload[entry.target_system_ofs] = elsewhere ? script.byte() : static_cast<uint8_t>(script.below(2));
    }
    if ((entry.flags & MAV_MSG_ENTRY_FLAG_HAVE_TARGET_COMPONENT) != 0) {
        payload[entry.target_component_ofs] = elsewhere ? script.byte() : static_cast<uint8_t>(script.below(2));
    }
}

} // namespace

const mavlink_msg_entry_t &pick_message(Script &script, const Manners &manners) {
    if (!manners.only_nonsense && script.one_in(8)) {
        return entry_number(script.byte());
    }
    const size_t count = manners.only_nonsense ? without_whole_numbers : std::size(listened_to);
    return *entry_of(listened_to[script.entry(count, [](size_t i) { return listened_to[i]; })]);
}

void fill_payload(uint8_t *payload, const mavlink_msg_entry_t &entry, Script &script, const Manners &manners) {
    if (!manners.only_nonsense && script.one_in(8)) {
        script.bytes(payload, entry.max_msg_len);
    } else {
        fill_fields(payload, entry.msgid, script, manners.only_nonsense);
    }
    if (entry.msgid == MAVLINK_MSG_ID_COMMAND_LONG || entry.msgid == MAVLINK_MSG_ID_COMMAND_INT) {
        fill_command(payload, script, manners);
    } else if (entry.msgid == MAVLINK_MSG_ID_PARAM_SET) {
        fill_param_set(payload, script, manners.only_nonsense);
    }
    address(payload, entry, script);
}

size_t parameter_for(uint32_t draw) {
    return entry_for(draw, OMNI_PARAM_COUNT, [](size_t i) { return omni_param_table[i].storage_key; });
}

Bytes command_long(uint16_t command, float param1, float param2) {
    mavlink_command_long_t message{};
    message.command = command;
    message.param1 = param1;
    message.param2 = param2;
    return frame_of(MAVLINK_MSG_ID_COMMAND_LONG, message);
}

Bytes velocity_target(float vx_m_s) {
    mavlink_set_position_target_local_ned_t message{};
    message.coordinate_frame = MAV_FRAME_BODY_FRD;
    message.type_mask = 0x5C7; // velocity and yaw rate only
    message.vx = vx_m_s;
    return frame_of(MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED, message);
}

} // namespace fuzz
