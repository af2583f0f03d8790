// SPDX-License-Identifier: MIT
#include "app/services/heartbeats.h"

#include "app/base/flash_code.h"
#include "app/link/mavlink_types.h"

namespace omni {
namespace {

/// Minimum interval of reports of refused senders to the station in command.
constexpr uint64_t told_interval_us = 5'000'000;

OMNI_COLD Text &add_station(Text &text, const Sender &sender) {
    return text.add(" station ")
        .add(uint32_t{sender.system})
        .add("/")
        .add(uint32_t{sender.component})
        .add(" on link ")
        .add(static_cast<uint32_t>(sender.link + 1));
}

} // namespace

bool Heartbeats::is_ground_station(const Frame &frame) {
    const auto message = frame.as<mavlink_heartbeat_t>();
    return message.type == MAV_TYPE_GCS && message.autopilot == MAV_AUTOPILOT_INVALID;
}

void Heartbeats::record(const Sender &sender) {
    stations.record_heartbeat(sender, clock_.now_us);
    if (stations.counts(sender)) {
        control_.set_heartbeat(stations.heard_us(sender));
    }
}

bool Heartbeats::may_move(const Sender &sender, bool streamed) {
    if (!robot_.armed() || stations.counts(sender) || stations.alive(sender, clock_.now_us)) {
        return true;
    }
    refuse_motion(sender, streamed);
    return false;
}

OMNI_COLD void Heartbeats::refuse_motion(const Sender &sender, bool streamed) {
    const Sender holder = stations.holder();
    Text text;
    add_station(text.add("refused:"), holder).add(" commands");
    if (streamed) {
        texts_.refuse_rate_limited(refused_us_, text);
    } else {
        texts_.refuse(MAV_SEVERITY_WARNING, text);
    }
    const bool quiet = told_us_ != 0 && clock_.now_us >= told_us_ && clock_.now_us - told_us_ < told_interval_us;
    if (!quiet) {
        told_us_ = clock_.now_us > 0 ? clock_.now_us : 1;
        Text other;
        texts_.send_to(holder.link, MAV_SEVERITY_WARNING, add_station(other.add("not followed:"), sender));
    }
}

/// Called after the stop has been executed.
OMNI_COLD void Heartbeats::notify_displaced_station(const char *did, const Sender &sender) {
    if (robot_.armed() && !stations.counts(sender)) {
        Text text;
        texts_.say(MAV_SEVERITY_NOTICE, add_station(text.add(did).add(" by"), sender));
    }
}

void Heartbeats::armed_by(const Sender &sender) {
    notify_displaced_station("taken over", sender); // an arm command of another station has been accepted just now
    stations.start_drive(sender);
    stations.take_command(sender, clock_.now_us);
    record(sender);
}

void Heartbeats::take_command_by_setpoint(const Sender &sender) {
    if (robot_.state() == OMNI_STATE_ARMED) {
        stations.record_drive(sender, clock_.now_us);
    }
    take_over(sender);
}

void Heartbeats::commanded(const Sender &sender) {
    stations.start_drive(sender);
    take_over(sender);
}

void Heartbeats::held(const Sender &sender) {
    notify_displaced_station("held", sender);
    stations.end_other_drives(sender);
    if (can_take_command(sender)) {
        take_command(sender);
    }
}

bool Heartbeats::can_take_command(const Sender &sender) const {
    return robot_.armed() && !stations.commands(sender) && stations.alive(sender, clock_.now_us);
}

void Heartbeats::take_command(const Sender &sender) {
    stations.take_command(sender, clock_.now_us);
    control_.set_heartbeat(stations.heard_us(sender));
}

void Heartbeats::take_over(const Sender &sender) {
    if (can_take_command(sender)) {
        notify_displaced_station("taken over", sender);
        take_command(sender);
    }
}

} // namespace omni
