// SPDX-License-Identifier: MIT
/// @file links.h  The robot's links, by number. Link n is on the board's port n.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"
#include "app/link/link.h"

namespace omni {

/// "No link" as a link number.
constexpr size_t no_link = Board::max_ports;

/// Sender of a message: MAVLink system and component, and the link for the answer.
struct Sender {
    size_t link = 0;
    uint8_t system = 0;
    uint8_t component = 0;

    bool operator==(const Sender &other) const {
        return link == other.link && system == other.system && component == other.component;
    }
};

class Links {
public:
    /// @param board its ports; radio ports get signing. @param signing checks frames from radios.
    void attach(const Board &board, Signing &signing);
    size_t count() const { return count_; }
    Link &operator[](size_t link) { return links_[link]; }
    const Link &operator[](size_t link) const { return links_[link]; }
    /// A wired link is connected, or the board has none: a message reaches someone with physical access.
    bool cable_connected() const;
    /// See Link::set_unlimited().
    void set_unlimited(bool unlimited);
    /// Answer on the link of the sender. @return false if the answer was dropped.
    template <class Message>
    bool reply(const Sender &to, uint32_t id, const Message &message) {
        return links_[to.link].send(id, message, Priority::reply);
    }

private:
    Link links_[Board::max_ports];
    size_t count_ = 0;
};

} // namespace omni
