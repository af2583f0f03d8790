// SPDX-License-Identifier: MIT
/// @file services.h  Small protocol services that ground stations expect of everybody: time sync, ping, no missions, no
/// files.
#pragma once

#include "app/base/robot_clock.h"
#include "app/link/links.h"

namespace omni {

/// Answer a message if it is one of theirs.
void serve_small_protocols(Links &links, const RobotClock &clock, const Frame &frame, const Sender &sender);

} // namespace omni
