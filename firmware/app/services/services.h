// SPDX-License-Identifier: MIT
/// @file services.h  Minimal MAVLink services that ground stations expect: time sync, ping, empty mission list, no FTP.
#pragma once

#include "app/base/robot_clock.h"
#include "app/link/links.h"

namespace omni {

/// Answer a message of these services.
void serve_small_protocols(Links &links, const RobotClock &clock, const Frame &frame, const Sender &sender);

} // namespace omni
