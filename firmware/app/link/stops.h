// SPDX-License-Identifier: MIT
/// @file stops.h  Stop messages, which have priority on reception, and their acknowledgements on transmission.
#pragma once

#include "app/link/mavlink_frame.h"

namespace omni {

/// Maximum length of a stop frame: MAVLink 2's header, COMMAND_INT, checksum, signature [bytes].
constexpr size_t longest_stop = 10 + 35 + 2 + signature_length;

/// Is it an emergency stop, a flight termination or a disarm command? The target is not checked.
bool is_stop(const Frame &frame);

} // namespace omni
