// SPDX-License-Identifier: MIT
#include "app/heartbeats.h"

namespace omni {

void Heartbeats::heard(size_t link) {
    stations.hear(link, clock_.now_us);
    if (stations.counts(link)) {
        control_.set_heartbeat(stations.heard_us(link));
    }
}

void Heartbeats::commanded(size_t link) {
    if (robot_.armed() && stations.commander() != link && stations.alive(link, clock_.now_us)) {
        stations.take_command(link);
        control_.set_heartbeat(stations.heard_us(link));
    }
}

} // namespace omni
