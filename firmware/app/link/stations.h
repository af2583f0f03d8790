// SPDX-License-Identifier: MIT
/// @file stations.h  Ground stations: their heartbeats, and which one is in command.
///
/// A station is a component on a link. The one that armed the robot is in command. Another one whose heartbeats come,
/// too, takes the command over with its first accepted setpoint or motion command. Only heartbeats of the station in
/// command keep an armed robot going; while it is not armed, any station's do.
///
/// A drive ends when the robot stops or is disarmed, and when another station holds it or takes the command. From then
/// on setpoints of the station that drove are refused: its program may not know yet that its drive has ended, and goes
/// on sending. Its next arm or start command makes them count again. So does a silence, after which it may be another
/// program.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/link/links.h"

namespace omni {

class Stations {
public:
    static constexpr size_t nobody = Board::max_ports;
    /// Stations that are known at a time. A new one replaces the one that has been silent for longest.
    static constexpr size_t most = 8;
    /// A component that is silent for longer may be another program.
    static constexpr uint64_t away_us = 10'000'000;

    /// Forget everything: the clock starts over.
    void restart();
    /// @param timeout_us silence after which a ground station counts as lost (SAFE_LINK_TO).
    void set_timeout(uint64_t timeout_us) { timeout_us_ = timeout_us; }
    void hear(const Sender &sender, uint64_t now_us);
    /// Latest heartbeat of this station; 0: none.
    uint64_t heard_us(const Sender &sender) const;
    /// Latest heartbeat of any station on this link; 0: none.
    uint64_t heard_us(size_t link) const;
    bool alive(const Sender &sender, uint64_t now_us) const { return is_recent(heard_us(sender), now_us); }
    /// The same, where a request of this time counts as a heartbeat.
    bool present(const Sender &sender, uint64_t asked_us, uint64_t now_us) const {
        return alive(sender, now_us) || is_recent(asked_us, now_us);
    }
    /// Heartbeats of this station keep the robot going.
    bool counts(const Sender &sender) const { return commander_ == most || find(sender) == commander_; }
    bool commands(const Sender &sender) const { return commander_ != most && find(sender) == commander_; }
    /// Link of the station in command, or `nobody`.
    size_t commander() const { return commander_ == most ? nobody : stations_[commander_].who.link; }
    /// The station in command, where there is one.
    Sender holder() const { return commander_ == most ? Sender{} : stations_[commander_].who; }
    /// The drives of all others end with it.
    void take_command(const Sender &sender, uint64_t now_us);
    void release();

    /// Setpoints of this sender count. Ask once per setpoint: one that is refused is a sign of life of its program.
    bool may_stream(const Sender &sender, uint64_t now_us);
    /// Setpoints of this sender come, used or not: the latest is at most this old.
    bool streams(const Sender &sender, uint64_t now_us, uint64_t most_us) const;
    /// A setpoint of this sender has moved an armed robot, or may have.
    void drove(const Sender &sender, uint64_t now_us) { stations_[find_or_add(sender, now_us)].drove = true; }
    /// This sender commands anew: its setpoints count.
    void begin_drive(const Sender &sender);
    /// The drives of all others have ended.
    void end_drives_but(const Sender &sender);

    enum class Change : uint8_t { none, lost, back };
    /// Once per pass and link while armed. @return what there is to say about it. Of the link in command it is the
    /// station in command that counts.
    Change watch(size_t link, uint64_t now_us);

private:
    struct Station {
        Sender who;
        uint64_t heard_us = 0;    ///< its latest heartbeat; 0: none
        uint64_t seen_us = 0;     ///< its latest message of those that are looked at here
        uint64_t streamed_us = 0; ///< its latest setpoint; 0: none
        bool used = false;
        bool drove = false;
        bool ended = false; ///< its drive, which its setpoints may still belong to
    };
    bool is_recent(uint64_t heard_us, uint64_t now_us) const;
    /// @return its index, or `most`.
    size_t find(const Sender &sender) const;
    size_t find_or_add(const Sender &sender, uint64_t now_us);
    size_t free_place() const;

    Station stations_[most];
    bool lost_[Board::max_ports] = {};
    Sender newcomer_; ///< the latest that sent a setpoint before its first heartbeat
    uint64_t newcomer_us_ = 0;
    uint64_t timeout_us_ = 0;
    size_t commander_ = most;
};

} // namespace omni
