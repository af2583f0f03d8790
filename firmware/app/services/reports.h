// SPDX-License-Identifier: MIT
/// @file reports.h  Telemetry messages from the latest tick. Standard messages in NED/FRD (frames.h).
///
/// Messages and fields are defined in shared/link/telemetry.toml, from which the functions are generated. Helper
/// functions used there are in reports.cpp.
#pragma once

#include "app/base/robot_clock.h"
#include "app/link/legacy_line.h"
#include "app/link/links.h"
#include "app/link/signing.h"
#include "app/services/parameters.h"
#include "app/services/robot_state.h"
#include "omni/telemetry_gen.h"

namespace omni {

/// Data sources of the messages, read only.
struct ReportSources {
    const Board &board;
    const RobotClock &clock;
    const RobotState &robot;
    const Links &links;
    const Signing &signing;
    const LegacyLine &legacy_line;
    const Parameters &parameters;
};

/// Fills a message and sends it. @return false if it was dropped. @param asked true: by REQUEST_MESSAGE, false:
/// streamed.
using ReportFunction = bool (*)(const ReportSources &sources, Link &link, Priority priority, bool asked);

/// Rate group of a streamed message.
enum class Group : uint8_t {
    always, ///< once a second
    state,  ///< SRn_STATE
    wheels, ///< SRn_WHEELS
    status, ///< SRn_STATUS
    asked,  ///< only on request
};
constexpr Group groups[] = {Group::always, Group::state, Group::wheels, Group::status, Group::asked};

struct Stream {
    uint32_t id;
    Group group;
    ReportFunction report;
};

/// In order of priority under a limited budget.
extern const Stream streams[telemetry_stream_count];

/// AUTOPILOT_VERSION, on request only. @return false if it was dropped.
bool report_version(Link &link, const Board &board);

} // namespace omni
