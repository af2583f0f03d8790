// SPDX-License-Identifier: MIT
#include "app/services/heartbeats.h"

#include "app/link/mavlink_types.h"

namespace omni {

bool Heartbeats::is_of_station(const Frame &frame) {
    const auto message = frame.as<mavlink_heartbeat_t>();
    return message.type == MAV_TYPE_GCS && message.autopilot == MAV_AUTOPILOT_INVALID;
}

void Heartbeats::heard(const Sender &sender) {
    stations.hear(sender, clock_.now_us);
    if (stations.counts(sender)) {
        control_.set_heartbeat(stations.heard_us(sender));
    }
}

void Heartbeats::armed_by(const Sender &sender) {
    stations.begin_drive(sender);
    stations.take_command(sender, clock_.now_us);
    heard(sender);
}

void Heartbeats::streamed(const Sender &sender) {
    if (robot_.state() == OMNI_STATE_ARMED) {
        stations.drove(sender, clock_.now_us);
    }
    take_command(sender);
}

void Heartbeats::commanded(const Sender &sender) {
    stations.begin_drive(sender);
    take_command(sender);
}

void Heartbeats::held(const Sender &sender) {
    stations.end_drives_but(sender);
    take_command(sender);
}

void Heartbeats::take_command(const Sender &sender) {
    if (robot_.armed() && !stations.commands(sender) && stations.alive(sender, clock_.now_us)) {
        stations.take_command(sender, clock_.now_us);
        control_.set_heartbeat(stations.heard_us(sender));
    }
}

} // namespace omni
