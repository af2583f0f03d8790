// SPDX-License-Identifier: MIT
#include "app/link/stations.h"

#include <algorithm>

#include "app/base/flash_code.h"

namespace omni {

OMNI_COLD void Stations::restart() {
    std::fill(stations_, stations_ + most, Station{});
    std::fill(lost_, lost_ + Board::max_ports, false);
    commander_ = most;
    newcomer_us_ = 0;
}

OMNI_COLD size_t Stations::find(const Sender &sender) const {
    size_t i = 0;
    while (i < most && !(stations_[i].used && stations_[i].sender == sender)) {
        ++i;
    }
    return i;
}

/// Entry to replace: never the station in command; one whose drive has ended only if there is no other, as its
/// setpoints would be accepted again.
OMNI_COLD size_t Stations::free_place() const {
    size_t place = most;
    for (size_t i = 0; i < most; ++i) {
        if (!stations_[i].used) {
            return i;
        }
        const bool both = place != most && stations_[i].ended == stations_[place].ended;
        const bool older =
            place == most || (both ? stations_[i].seen_us < stations_[place].seen_us : stations_[place].ended);
        place = i != commander_ && older ? i : place;
    }
    return place;
}

OMNI_COLD size_t Stations::find_or_add(const Sender &sender, uint64_t now_us) {
    size_t i = find(sender);
    if (i == most) {
        i = free_place();
        stations_[i] = Station{};
        stations_[i].sender = sender;
        stations_[i].used = true;
    }
    stations_[i].seen_us = now_us;
    return i;
}

OMNI_COLD void Stations::take_command(const Sender &sender, uint64_t now_us) {
    commander_ = find_or_add(sender, now_us);
    end_other_drives(sender);
}

OMNI_COLD void Stations::release() {
    commander_ = most;
    for (Station &station : stations_) {
        station.ended = station.ended || station.drove;
        station.drove = false;
    }
}

bool Stations::accepts_setpoints(const Sender &sender, uint64_t now_us) {
    const size_t i = find(sender);
    if (i == most) {
        newcomer_ = sender;
        newcomer_us_ = now_us > 0 ? now_us : 1;
        return true;
    }
    Station &station = stations_[i];
    station.ended = station.ended && now_us - station.seen_us <= away_us;
    station.seen_us = now_us;
    station.streamed_us = now_us > 0 ? now_us : 1;
    return !station.ended;
}

OMNI_COLD bool Stations::is_streaming(const Sender &sender, uint64_t now_us, uint64_t max_age_us) const {
    const size_t i = find(sender);
    const uint64_t newcomer_us = newcomer_ == sender ? newcomer_us_ : 0;
    const uint64_t known_us = i < most ? stations_[i].streamed_us : 0;
    const uint64_t streamed_us = std::max(known_us, newcomer_us);
    return streamed_us != 0 && (now_us < streamed_us || now_us - streamed_us <= max_age_us);
}

OMNI_COLD void Stations::start_drive(const Sender &sender) {
    const size_t i = find(sender);
    if (i < most) {
        stations_[i].ended = false;
    }
}

/// The station in command counts as driving: its first setpoint may still be in transit.
OMNI_COLD void Stations::end_other_drives(const Sender &sender) {
    for (size_t i = 0; i < most; ++i) {
        Station &station = stations_[i];
        if ((station.drove || i == commander_) && !(station.sender == sender)) {
            station.ended = true;
            station.drove = false;
        }
    }
}

void Stations::record_heartbeat(const Sender &sender, uint64_t now_us) {
    stations_[find_or_add(sender, now_us)].heard_us = now_us > 0 ? now_us : 1;
}

uint64_t Stations::heard_us(const Sender &sender) const {
    const size_t i = find(sender);
    return i < most ? stations_[i].heard_us : 0;
}

uint64_t Stations::heard_us(size_t link) const {
    uint64_t latest_us = 0;
    for (const Station &station : stations_) {
        latest_us = station.used && station.sender.link == link ? std::max(latest_us, station.heard_us) : latest_us;
    }
    return latest_us;
}

bool Stations::is_recent(uint64_t heard_us, uint64_t now_us) const {
    return heard_us != 0 && (now_us < heard_us || now_us - heard_us <= timeout_us_);
}

Stations::Change Stations::watch(size_t link, uint64_t now_us) {
    const uint64_t heard = commander() == link ? stations_[commander_].heard_us : heard_us(link);
    const bool lost = heard != 0 && !is_recent(heard, now_us);
    if (lost == lost_[link]) {
        return Change::none;
    }
    lost_[link] = lost;
    return lost ? Change::lost : Change::back;
}

} // namespace omni
