// SPDX-License-Identifier: MIT
/// @file stations.h  Whose robot it is: signs of life of the ground stations per link, and which link has the command.
///
/// The link that armed the robot has the command. It goes to another link whose ground station is alive, too, with the
/// first accepted set-point or motion command from there. Only heartbeats on the link in command keep an armed robot
/// going; while it is not armed any link's do.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/board.h"

namespace omni {

class Stations {
public:
    static constexpr size_t nobody = Board::max_ports;

    /// Forget everything: the clock starts over.
    void restart();
    /// @param timeout_us silence after which a ground station counts as lost (SAFE_LINK_TO).
    void set_timeout(uint64_t timeout_us) { timeout_us_ = timeout_us; }
    void hear(size_t link, uint64_t now_us) { heard_us_[link] = now_us > 0 ? now_us : 1; }
    /// Latest heartbeat on this link; 0: none.
    uint64_t heard_us(size_t link) const { return heard_us_[link]; }
    bool alive(size_t link, uint64_t now_us) const;
    /// Heartbeats on this link keep the robot going.
    bool counts(size_t link) const { return commander_ == nobody || commander_ == link; }
    size_t commander() const { return commander_; }
    void take_command(size_t link) { commander_ = link; }
    void release() { commander_ = nobody; }

    enum class Change : uint8_t { none, lost, back };
    /// Once per pass and link while armed. @return what there is to say about it.
    Change watch(size_t link, uint64_t now_us);

private:
    uint64_t heard_us_[Board::max_ports] = {};
    bool lost_[Board::max_ports] = {};
    uint64_t timeout_us_ = 0;
    size_t commander_ = nobody;
};

} // namespace omni
