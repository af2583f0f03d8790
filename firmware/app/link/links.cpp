// SPDX-License-Identifier: MIT
#include "app/link/links.h"

namespace omni {

void Links::attach(const Board &board, Signing &signing) {
    count_ = board.port_count;
    for (size_t i = 0; i < count_; ++i) {
        links_[i].attach(board.ports[i], static_cast<uint8_t>(i), board.ports[i]->is_radio() ? &signing : nullptr);
    }
}

bool Links::cable_connected() const {
    bool connected = false;
    bool any = false;
    for (size_t i = 0; i < count_; ++i) {
        any = any || !links_[i].is_radio();
        connected = connected || (!links_[i].is_radio() && links_[i].connected());
    }
    return connected || !any;
}

void Links::set_unlimited(bool unlimited) {
    for (size_t i = 0; i < count_; ++i) {
        links_[i].set_unlimited(unlimited);
    }
}

} // namespace omni
