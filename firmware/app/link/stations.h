// SPDX-License-Identifier: MIT
/// @file stations.h  Ground stations: heartbeats, and arbitration of command.
///
/// A station is a component on a link. The one that armed the robot is in command. Another one with valid heartbeats
/// takes command with its first accepted setpoint or motion command. While armed, only heartbeats of the station in
/// command prevent the link-loss fault; otherwise any station's do.
///
/// A drive ends when the robot stops or is disarmed, and when another station holds it or takes command. After that
/// setpoints of the previous station are refused, as its program may not have noticed yet. Its next arm or start
/// command makes them valid again, and so does a silence of `away_us`.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/link/links.h"

namespace omni {

class Stations {
public:
    /// Size of the table. A new station replaces the one that has been silent for longest.
    static constexpr size_t most = 8;
    /// After a silence of this length a component is treated as a new program.
    static constexpr uint64_t away_us = 10'000'000;

    /// Clear the table, after a restart of the clock.
    void restart();
    /// @param timeout_us heartbeat timeout (SAFE_LINK_TO).
    void set_timeout(uint64_t timeout_us) { timeout_us_ = timeout_us; }
    /// Record a heartbeat.
    void record_heartbeat(const Sender &sender, uint64_t now_us);
    /// Latest heartbeat of this station; 0: none.
    uint64_t heard_us(const Sender &sender) const;
    /// Latest heartbeat of any station on this link; 0: none.
    uint64_t heard_us(size_t link) const;
    bool alive(const Sender &sender, uint64_t now_us) const { return is_recent(heard_us(sender), now_us); }
    /// Is it alive, or was its request at `asked_us` within the timeout?
    bool present(const Sender &sender, uint64_t asked_us, uint64_t now_us) const {
        return alive(sender, now_us) || is_recent(asked_us, now_us);
    }
    /// Do heartbeats of this station prevent the link-loss fault?
    bool counts(const Sender &sender) const { return commander_ == most || find(sender) == commander_; }
    bool commands(const Sender &sender) const { return commander_ != most && find(sender) == commander_; }
    /// Link of the station in command, or `no_link`.
    size_t commander() const { return commander_ == most ? no_link : stations_[commander_].sender.link; }
    /// Station in command; default if none.
    Sender holder() const { return commander_ == most ? Sender{} : stations_[commander_].sender; }
    /// Put this sender in command; ends the drives of all others.
    void take_command(const Sender &sender, uint64_t now_us);
    void release();

    /// Are setpoints of this sender accepted? Call once per setpoint: a refused one also restarts the silence timer.
    bool accepts_setpoints(const Sender &sender, uint64_t now_us);
    /// Is this sender streaming setpoints, accepted or not: is the latest at most this old?
    bool is_streaming(const Sender &sender, uint64_t now_us, uint64_t max_age_us) const;
    /// Record that a setpoint of this sender may have moved an armed robot.
    void record_drive(const Sender &sender, uint64_t now_us) { stations_[find_or_add(sender, now_us)].drove = true; }
    /// Start a new drive of this sender: its setpoints are accepted again.
    void start_drive(const Sender &sender);
    /// End the drives of all other senders.
    void end_other_drives(const Sender &sender);

    enum class Change : uint8_t { none, lost, back };
    /// Detect loss and return of heartbeats, once per pass and link while armed. On the link of the station in command
    /// only that station is watched.
    Change watch(size_t link, uint64_t now_us);

private:
    struct Station {
        Sender sender;
        uint64_t heard_us = 0;    ///< latest heartbeat; 0: none
        uint64_t seen_us = 0;     ///< latest heartbeat, setpoint or command
        uint64_t streamed_us = 0; ///< latest setpoint; 0: none
        bool used = false;
        bool drove = false; ///< its setpoints may have moved the robot in the current drive
        bool ended = false; ///< its drive has ended: setpoints are refused
    };
    bool is_recent(uint64_t heard_us, uint64_t now_us) const;
    /// Index of a station, or `most`.
    size_t find(const Sender &sender) const;
    size_t find_or_add(const Sender &sender, uint64_t now_us);
    size_t free_place() const;

    Station stations_[most];
    bool lost_[Board::max_ports] = {};
    Sender newcomer_; ///< latest sender of a setpoint without a heartbeat yet
    uint64_t newcomer_us_ = 0;
    uint64_t timeout_us_ = 0;
    size_t commander_ = most;
};

} // namespace omni
