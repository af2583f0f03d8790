// SPDX-License-Identifier: MIT
#include "app/link/stops.h"

#include "app/link/mavlink_types.h"

namespace omni {
namespace {

static_assert(longest_stop >= 12 + signature_length + MAVLINK_MSG_ID_COMMAND_INT_LEN, "a stop may be longer");
static_assert(longest_stop >= 12 + signature_length + MAVLINK_MSG_ID_COMMAND_LONG_LEN, "a stop may be longer");

/// Same interpretation as in Commands: everything but an exact release stops; only an exact 0 disarms.
bool is_stop(uint16_t command, float param1) {
    switch (command) {
    case MAV_CMD_COMPONENT_ARM_DISARM:
        return param1 == 0.0f;
    case MAV_CMD_DO_FLIGHTTERMINATION:
        return param1 > 0.5f;
    case MAV_CMD_OMNI_ESTOP:
        return param1 != 0.0f;
    default:
        return false;
    }
}

} // namespace

bool is_stop(const Frame &frame) {
    if (frame.id == MAVLINK_MSG_ID_COMMAND_LONG) {
        const auto message = frame.as<mavlink_command_long_t>();
        return is_stop(message.command, message.param1);
    }
    if (frame.id == MAVLINK_MSG_ID_COMMAND_INT) {
        const auto message = frame.as<mavlink_command_int_t>();
        return is_stop(message.command, message.param1);
    }
    return false;
}

} // namespace omni
