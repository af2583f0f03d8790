// SPDX-License-Identifier: MIT
#include "app/stations.h"

#include <algorithm>

namespace omni {

void Stations::restart() {
    std::fill(heard_us_, heard_us_ + Board::max_ports, uint64_t{0});
    std::fill(lost_, lost_ + Board::max_ports, false);
    commander_ = nobody;
}

bool Stations::alive(size_t link, uint64_t now_us) const {
    const uint64_t heard_us = heard_us_[link];
    return heard_us != 0 && (now_us < heard_us || now_us - heard_us <= timeout_us_);
}

Stations::Change Stations::watch(size_t link, uint64_t now_us) {
    const bool lost = heard_us_[link] != 0 && !alive(link, now_us);
    if (lost == lost_[link]) {
        return Change::none;
    }
    lost_[link] = lost;
    return lost ? Change::lost : Change::back;
}

} // namespace omni
