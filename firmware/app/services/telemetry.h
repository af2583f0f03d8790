// SPDX-License-Identifier: MIT
/// @file telemetry.h  Telemetry streams: messages with an interval per link, highest priority first.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/services/reports.h"

namespace omni {

class Telemetry {
public:
    static constexpr size_t stream_count = telemetry_stream_count;

    Telemetry(Links &links, const ReportSources &sources)
        : links_(links), sources_(sources), clock_(sources.clock), robot_(sources.robot) {}

    /// Set the rates of this link from SRn_*.
    void set_rates(size_t link, const omni_real_t *values);
    /// MAV_CMD_SET_MESSAGE_INTERVAL. @param interval_us -1: off; 0: as at boot. @return MAV_RESULT
    uint8_t set_interval(size_t link, float id, float interval_us, const omni_real_t *values);
    /// MAV_CMD_REQUEST_MESSAGE, for streamed messages. @return false if it is another message.
    bool send_once(size_t link, uint32_t id);
    /// AUTOPILOT_VERSION. @return false if it was dropped.
    bool send_version(size_t link) { return report_version(links_[link], sources_.board); }
    /// REQUEST_DATA_STREAM: request by message group (MAVLink 1).
    void on_request_data_stream(const Frame &frame, const Sender &sender);
    /// Send messages that are due.
    void serve();
    /// Make all streams due now: after a change of the clock or a new connection.
    void restart();
    void restart(size_t link);

private:
    struct Due {
        uint32_t interval_us = 0; ///< 0: off
        uint64_t next_us = 0;
    };
    void set_group(size_t link, Group group, float rate_Hz);
    void watch_state();
    size_t next_stream(size_t link) const;
    void serve_link(size_t link);

    Links &links_;
    const ReportSources sources_;
    const RobotClock &clock_;
    const RobotState &robot_;
    uint8_t state_ = OMNI_STATE_INIT;
    Due due_[Board::max_ports][stream_count] = {};
    bool blocked_[Board::max_ports] = {}; ///< a due stream is blocked by lack of room
};

} // namespace omni
