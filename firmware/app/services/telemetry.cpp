// SPDX-License-Identifier: MIT
#include "app/services/telemetry.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "app/base/flash_code.h"

namespace omni {
namespace {

constexpr uint64_t radio_spread_us = 70'000;
/// Waiting time after which a stream has priority over more important ones.
constexpr uint64_t longest_wait_us = 1'000'000;
constexpr float min_interval_us = 1000.0f;
constexpr float max_interval_us = 4.0e9f;
/// Minimum rate of the heartbeat, which cannot be switched off: stations detect the robot by it.
constexpr float max_heartbeat_us = 2.0e6f;

/// @return stream number, or stream_count if no stream sends this message.
size_t find_stream(uint32_t id) {
    size_t i = 0;
    while (i < Telemetry::stream_count && streams[i].id != id) {
        ++i;
    }
    return i;
}

uint32_t interval_of(float rate_Hz) {
    return rate_Hz > 0.0f ? static_cast<uint32_t>(std::lround(1.0e6f / rate_Hz)) : 0;
}

/// Rate at boot: SRn_STATE, SRn_WHEELS, SRn_STATUS; heartbeat 1 Hz, on-request messages 0.
float boot_rate(size_t link, Group group, const omni_real_t *values) {
    switch (group) {
    case Group::state:
        return values[OMNI_PARAM_SR1_STATE + link];
    case Group::wheels:
        return values[OMNI_PARAM_SR1_WHEELS + link];
    case Group::status:
        return values[OMNI_PARAM_SR1_STATUS + link];
    case Group::asked:
        return 0.0f;
    default:
        return 1.0f;
    }
}

bool is_valid_id(float id) {
    return id >= 0.0f && id < 16777216.0f;
}

} // namespace

OMNI_COLD void Telemetry::set_group(size_t link, Group group, float rate_Hz) {
    for (size_t i = 0; i < stream_count; ++i) {
        // Frames longer than a radio's packet are sent there only on explicit request.
        const bool too_long = links_[link].is_radio() && longest_frame(streams[i].id) > Link::radio_frame;
        if (streams[i].group == group) {
            Due &due = due_[link][i];
            due.next_us = due.interval_us == 0 ? clock_.now_us : due.next_us;
            due.interval_us = too_long ? 0 : interval_of(rate_Hz);
        }
    }
}

OMNI_COLD void Telemetry::set_rates(size_t link, const omni_real_t *values) {
    for (const Group group : groups) {
        set_group(link, group, boot_rate(link, group, values));
    }
}

OMNI_COLD uint8_t Telemetry::set_interval(size_t link, float id, float interval_us, const omni_real_t *values) {
    const size_t stream = is_valid_id(id) ? find_stream(static_cast<uint32_t>(id)) : stream_count;
    if (stream == stream_count) {
        return MAV_RESULT_UNSUPPORTED;
    }
    const bool essential = streams[stream].id == MAVLINK_MSG_ID_HEARTBEAT;
    if (essential && !(interval_us >= 0.0f && interval_us <= max_heartbeat_us)) {
        return MAV_RESULT_DENIED;
    }
    Due &due = due_[link][stream];
    if (interval_us == 0.0f) {
        due.interval_us = interval_of(boot_rate(link, streams[stream].group, values));
    } else if (interval_us == -1.0f) {
        due.interval_us = 0;
    } else if (interval_us >= min_interval_us && interval_us <= max_interval_us) {
        due.interval_us = static_cast<uint32_t>(interval_us);
    } else {
        return MAV_RESULT_DENIED;
    }
    due.next_us = clock_.now_us;
    return MAV_RESULT_ACCEPTED;
}

bool Telemetry::send_once(size_t link, uint32_t id) {
    const size_t stream = find_stream(id);
    if (stream == stream_count) {
        return false;
    }
    streams[stream].report(sources_, links_[link], Priority::reply, true);
    return true;
}

OMNI_COLD void Telemetry::on_request_data_stream(const Frame &frame, const Sender &sender) {
    const auto message = frame.as<mavlink_request_data_stream_t>();
    constexpr uint8_t all = 0;
    constexpr uint8_t extended_status = 2;
    constexpr uint8_t position = 6;
    constexpr uint8_t extra1 = 10;
    const uint8_t wanted = message.req_stream_id;
    const float rate = message.start_stop != 0 ? static_cast<float>(message.req_message_rate) : 0.0f;
    if (rate > 1000.0f) {
        return;
    }
    if (wanted == all || wanted == position) {
        set_group(sender.link, Group::state, rate);
    }
    if (wanted == all || wanted == extra1) {
        set_group(sender.link, Group::wheels, rate);
    }
    if (wanted == all || wanted == extended_status) {
        set_group(sender.link, Group::status, rate);
    }
}

/// Send a change of the safety state at once.
void Telemetry::watch_state() {
    const uint8_t before = state_;
    state_ = robot_.state();
    if (state_ == before || before == OMNI_STATE_INIT) {
        return;
    }
    for (const uint32_t id : {uint32_t{MAVLINK_MSG_ID_HEARTBEAT}, uint32_t{MAVLINK_MSG_ID_OMNI_STATUS}}) {
        const size_t stream = find_stream(id);
        for (size_t link = 0; link < Board::max_ports; ++link) {
            due_[link][stream].next_us = clock_.now_us;
        }
    }
}

/// Next stream: the heartbeat, then the longest waiting of those beyond the maximum waiting time, then the most
/// important one. @return stream_count if none is due
size_t Telemetry::next_stream(size_t link) const {
    const uint64_t now_us = clock_.now_us;
    size_t first = stream_count;
    size_t oldest = stream_count;
    for (size_t i = 0; i < stream_count; ++i) {
        const Due &due = due_[link][i];
        if (due.interval_us == 0 || now_us < due.next_us) {
            continue;
        }
        if (streams[i].id == MAVLINK_MSG_ID_HEARTBEAT) {
            return i;
        }
        first = std::min(first, i);
        const bool overdue = now_us - due.next_us >= longest_wait_us;
        if (overdue && (oldest == stream_count || due.next_us < due_[link][oldest].next_us)) {
            oldest = i;
        }
    }
    return oldest != stream_count ? oldest : first;
}

/// Without room all streams wait for the next one. So on a slow link the least important streams become slower first,
/// and none starves.
void Telemetry::serve_link(size_t link) {
    for (size_t i = next_stream(link); i != stream_count; i = next_stream(link)) {
        if (!links_[link].admits(Priority::telemetry, longest_frame(streams[i].id))) {
            blocked_[link] = true;
            return;
        }
        Due &due = due_[link][i];
        const uint64_t late_us = clock_.now_us - due.next_us;
        if (late_us < due.interval_us) {
            due.next_us += due.interval_us;
        } else {
            // No waiting time: the clock was changed.
            links_[link].count_dropped(blocked_[link] ? static_cast<uint32_t>(late_us / due.interval_us) : 0);
            due.next_us = clock_.now_us + due.interval_us;
        }
        streams[i].report(sources_, links_[link], Priority::telemetry, false);
    }
    blocked_[link] = false;
}

void Telemetry::serve() {
    watch_state();
    for (size_t link = 0; link < links_.count(); ++link) {
        if (links_[link].connected()) {
            serve_link(link);
        }
    }
}

OMNI_COLD void Telemetry::restart(size_t link) {
    // On a radio one after the other: all at once would exceed the token bucket.
    const uint64_t spread_us = links_[link].is_radio() ? radio_spread_us : 0;
    for (size_t i = 0; i < stream_count; ++i) {
        due_[link][i].next_us = clock_.now_us + i * spread_us;
    }
}

OMNI_COLD void Telemetry::restart() {
    for (size_t link = 0; link < Board::max_ports; ++link) {
        restart(link);
    }
}

} // namespace omni
