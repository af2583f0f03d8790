// SPDX-License-Identifier: MIT
/// @file stops.h  Which messages stop a robot: they wait for nothing, neither on their way in nor their answers on the
/// way out.
#pragma once

#include "app/link/mavlink_frame.h"

namespace omni {

/// Longest frame that a stop can be: MAVLink 2's header, COMMAND_INT, checksum, signature [bytes].
constexpr size_t longest_stop = 10 + 35 + 2 + signature_length;

/// Whether this is an emergency stop, a flight termination or a disarm command. Whom it is meant for is not looked at.
bool is_stop(const Frame &frame);

} // namespace omni
