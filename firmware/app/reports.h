// SPDX-License-Identifier: MIT
/// @file reports.h  Fills the messages about the robot from the latest tick. Standard messages in NED/FRD (frames.h).
#pragma once

#include "app/shared.h"

namespace omni {

/// Fills a message and sends it. @return false if it was dropped. @param asked true: REQUEST_MESSAGE, false: streamed.
using ReportFunction = bool (*)(const Shared &shared, Link &link, Priority priority, bool asked);

bool report_heartbeat(const Shared &shared, Link &link, Priority priority, bool asked);
bool report_sys_status(const Shared &shared, Link &link, Priority priority, bool asked);
bool report_omni_status(const Shared &shared, Link &link, Priority priority, bool asked);
bool report_health(const Shared &shared, Link &link, Priority priority, bool asked);
bool report_local_position(const Shared &shared, Link &link, Priority priority, bool asked);
bool report_tracking(const Shared &shared, Link &link, Priority priority, bool asked);
bool report_attitude(const Shared &shared, Link &link, Priority priority, bool asked);
bool report_wheels(const Shared &shared, Link &link, Priority priority, bool asked);
bool report_control(const Shared &shared, Link &link, Priority priority, bool asked);
bool report_sample(const Shared &shared, Link &link, Priority priority, bool asked);
bool report_battery(const Shared &shared, Link &link, Priority priority, bool asked);
bool report_position_target(const Shared &shared, Link &link, Priority priority, bool asked);
bool report_odometry(const Shared &shared, Link &link, Priority priority, bool asked);
bool report_signing(const Shared &shared, Link &link, Priority priority, bool asked);
bool report_version(const Shared &shared, Link &link, Priority priority, bool asked);

} // namespace omni
