// SPDX-License-Identifier: MIT
/// @file messages.h  Payloads for the robot: of any message, with fields that are likely to matter.
#pragma once

#include <cstdint>

#include "frames.h"
#include "script.h"

namespace fuzz {

/// What a script may say.
struct Manners {
    bool may_arm = false;
    bool only_nonsense = false;
};

/// Fill a payload of 255 bytes for this message. Without `may_arm` it never is a request to arm.
void fill_payload(uint8_t *payload, const mavlink_msg_entry_t &entry, Script &script, const Manners &manners);
/// A message that the robot listens to, or sometimes any other.
const mavlink_msg_entry_t &pick_message(Script &script, const Manners &manners);
/// A parameter's place in the table. A new parameter leaves most draws as they were.
size_t parameter_for(uint32_t draw);
/// COMMAND_LONG to the robot.
Bytes command_long(uint16_t command, float param1, float param2 = 0.0f);
/// SET_POSITION_TARGET_LOCAL_NED: this speed forward.
Bytes velocity_target(float vx_m_s);

} // namespace fuzz
