// SPDX-License-Identifier: MIT
#include "app/services/burst_log.h"

#include <algorithm>
#include <cmath>

#include "app/base/flash_code.h"
#include "app/base/integer_check.h"

namespace omni {
namespace {

constexpr uint16_t log_id = 0;
/// Bytes in a LOG_DATA. A shorter one marks the end of the log.
constexpr uint32_t piece_bytes = sizeof(mavlink_log_data_t::data);
constexpr float longest_s = 1000.0f;
constexpr float most_every = 100.0f;

} // namespace

OMNI_COLD uint8_t BurstLog::refuse(const Text &why) {
    texts_.refuse(MAV_SEVERITY_WARNING, why);
    return MAV_RESULT_DENIED;
}

/// @return false if a parameter is not allowed by docs/reference/burst.md.
OMNI_COLD bool BurstLog::plan(float duration_s, float every, float signals, float wheels, BurstPlan &plan) const {
    const auto all_wheels = static_cast<float>((1u << parameters_.config().kinematics.wheels) - 1u);
    if (!(duration_s > 0.0f && duration_s <= longest_s) || !is_integer_within(every, 1.0f, most_every) ||
        !is_integer_within(signals, 0.0f, burst_all_signals) || !is_integer_within(wheels, 0.0f, all_wheels)) {
        return false;
    }
    const float tick_s = 1e-6f * static_cast<float>(OMNI_TICK_US);
    plan.samples = static_cast<uint32_t>(std::ceil(duration_s / (every * tick_s) - 1e-3f));
    plan.every = static_cast<uint16_t>(every);
    plan.signals = signals == 0.0f ? static_cast<uint16_t>(burst_all_signals) : static_cast<uint16_t>(signals);
    plan.wheels = static_cast<uint8_t>(wheels == 0.0f ? all_wheels : wheels);
    if (robot_.hil()) {
        plan.signals &= static_cast<uint16_t>(~burst_tick_time);
    }
    return plan.samples > 0;
}

OMNI_COLD uint8_t BurstLog::start(float duration_s, float every, float signals, float wheels, float wait) {
    BurstRecorder &burst = control_.burst;
    if (duration_s == 0.0f) {
        burst.stop();
        return MAV_RESULT_ACCEPTED;
    }
    BurstPlan wanted;
    if ((wait != 0.0f && wait != 1.0f) || !plan(duration_s, every, signals, wheels, wanted)) {
        return refuse(Text().add("burst: a number is out of its range"));
    }
    if (burst.recording()) {
        return refuse(Text().add("burst: one is being recorded"));
    }
    const uint32_t most = burst.capacity(wanted);
    if (wanted.samples > most) {
        const float most_s = 1e-6f * static_cast<float>(OMNI_TICK_US) * every * static_cast<float>(most);
        return refuse(Text().add("burst too long: ").add(most_s).add(" s fit"));
    }
    for (Stream &stream : streams_) {
        stream = {};
    }
    burst.prepare(wanted, parameters_.config());
    if (wait == 0.0f) {
        burst.trigger();
    }
    return MAV_RESULT_ACCEPTED;
}

OMNI_COLD void BurstLog::on_request_list(const Sender &sender) {
    mavlink_log_entry_t entry{};
    entry.size = static_cast<uint32_t>(control_.burst.size());
    entry.num_logs = entry.size > 0 ? 1 : 0;
    entry.id = log_id;
    entry.last_log_num = log_id;
    links_.reply(sender, MAVLINK_MSG_ID_LOG_ENTRY, entry);
}

OMNI_COLD void BurstLog::on_request_data(const Frame &frame, const Sender &sender) {
    const auto request = frame.as<mavlink_log_request_data_t>();
    const auto size = static_cast<uint32_t>(control_.burst.size());
    if (request.id != log_id || request.ofs >= size || request.count == 0) {
        mavlink_log_data_t nothing{};
        nothing.id = request.id;
        nothing.ofs = request.ofs;
        links_.reply(sender, MAVLINK_MSG_ID_LOG_DATA, nothing);
        return;
    }
    const uint32_t count = std::min(request.count, size - request.ofs);
    streams_[sender.link] = {request.ofs, request.ofs + count, true};
}

OMNI_COLD void BurstLog::on_erase(const Sender &) {
    if (!control_.burst.erase()) {
        texts_.refuse(MAV_SEVERITY_NOTICE, Text().add("there are no logs to erase"));
    }
}

/// @return false if no more can be sent now. A log whose last piece is full ends with an empty one.
OMNI_COLD bool BurstLog::send_piece(size_t link, Stream &stream) {
    const BurstRecorder &burst = control_.burst;
    mavlink_log_data_t piece{};
    piece.id = log_id;
    piece.ofs = stream.next;
    piece.count = static_cast<uint8_t>(std::min(stream.end - stream.next, piece_bytes));
    std::copy_n(burst.data() + stream.next, piece.count, piece.data);
    if (!links_[link].send(MAVLINK_MSG_ID_LOG_DATA, piece, Priority::bulk)) {
        return false;
    }
    stream.next += piece.count;
    stream.active = stream.next < stream.end || (stream.end == burst.size() && piece.count == piece_bytes);
    return stream.active;
}

OMNI_COLD void BurstLog::serve() {
    control_.burst.serve();
    for (size_t link = 0; link < links_.count(); ++link) {
        Stream &stream = streams_[link];
        stream.active = stream.active && control_.burst.size() > 0;
        while (stream.active && send_piece(link, stream)) {}
    }
}

} // namespace omni
