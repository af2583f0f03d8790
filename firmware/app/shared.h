// SPDX-License-Identifier: MIT
/// @file shared.h  What the background's modules have in common: links, the way to the tick, what the last tick said.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "app/board.h"
#include "app/control_loop.h"
#include "app/legacy_line.h"
#include "app/link.h"
#include "app/mavlink_types.h"
#include "app/signing.h"
#include "app/stations.h"
#include "app/text.h"
#include "app/text_gate.h"

namespace omni {

/// Who sent a message, and where the answer goes.
struct Sender {
    size_t link = 0;
    uint8_t system = 0;
    uint8_t component = 0;
};

struct Shared {
    explicit Shared(const Board &b) : board(b), signing(*b.storage) {}

    const Board &board;
    Signing signing;
    LegacyLine legacy_line; ///< on the radio
    Link links[Board::max_ports];
    ControlLoop control;
    TickReport latest;                       ///< of the last tick, refreshed once per background pass
    uint64_t now_us = 0;                     ///< robot clock of this pass: the board's, or the simulated one
    bool hil = false;                        ///< host-in-the-loop
    bool reboot = false;                     ///< asked for
    std::atomic<bool> button_pressed{false}; ///< the stop button was seen open since the last release
    bool hil_button_open = false;            ///< the simulated robot's stop button
    bool i2c_scanning = false;               ///< asked for, and its result not sent yet
    Stations stations;
    size_t asker = Board::max_ports; ///< link of the message that is being seen to; max_ports: none
    uint8_t stopping = 0;            ///< reports to wait for until one tells what became of a disarm or an emergency stop
    uint8_t arming = 0;              ///< reports to wait for until one tells what became of an accepted arm command

    uint32_t now_ms() const { return static_cast<uint32_t>(now_us / 1000); }
    /// Motors may move, or would but for a fault: what is locked while armed is locked now.
    bool armed() const {
        return arming > 0 || latest.outputs.state == OMNI_STATE_ARMED || latest.outputs.state == OMNI_STATE_FAILSAFE;
    }
    /// A stop is on its way, and the tick's report of it has not come yet: what is locked while armed is free in a moment.
    bool disarming() const { return armed() && stopping > 0; }
    /// Why not, of a command that is locked while armed. Its text goes to whoever asked. @param what is not done.
    /// @return MAV_RESULT: behind a stop it is to be tried again, since the answer to a stop comes before its report.
    uint8_t refuse_armed(const char *what);
    /// The same where there is no result to give: what helps.
    const char *way_out_of_armed() const { return disarming() ? "still stopping, try again" : "disarm first"; }
    /// Whoever has the robot in hand can be told something: a link that is no radio is connected, or there is none.
    bool cable_connected() const;
    /// The robot's stop button is open now, or the simulated one's.
    bool button_open() const { return (hil && hil_button_open) || (board.stop_button != nullptr && board.stop_button->open()); }
    /// From the tick: an emergency stop if the button is open, whatever else goes on. The first open sample stops
    /// (docs/reference/safety.md says why).
    void watch_button(bool open) {
        if (open) {
            button_pressed.store(true, std::memory_order_relaxed);
            control.stop(OMNI_EVENT_ESTOP);
        }
    }
    /// A ground station gave a sign of life on this link.
    void heartbeat(size_t link);
    /// A set-point or motion command of this link was accepted: it has the command from now on if its ground station is alive.
    void commanded(size_t link);
    /// The tick has reported once more.
    void count_report();
    /// Send a STATUSTEXT on every link, at most two a second after a burst. @param severity MAV_SEVERITY.
    void say(uint8_t severity, const Text &text);
    /// Tell whoever asked why not: on that link only, at most one a second after a burst. Everybody's business if nobody asked.
    void refuse(uint8_t severity, const Text &text);
    /// The same for what is streamed, at most once a second. @param said_us when it was last said on each link; 0: not yet.
    void refuse_streamed(uint64_t (&said_us)[Board::max_ports], const Text &text);
    /// Say how many texts were left out, where there were any.
    void say_left_out();
    /// The same on one link.
    void say_on(size_t link, uint8_t severity, const Text &text);
    /// Send a message on every link.
    template <class Message>
    void send_all(uint32_t id, const Message &message, Priority priority) {
        for (size_t i = 0; i < board.port_count; ++i) {
            links[i].send(id, message, priority);
        }
    }
    template <class Message>
    bool reply(const Sender &to, uint32_t id, const Message &message) {
        return links[to.link].send(id, message, Priority::reply);
    }

private:
    /// What a link was not told.
    struct Texts {
        TextGate news = TextGate(500'000);
        TextGate refusals = TextGate(1'000'000);
    };
    void send_text(size_t link, TextGate &gate, uint8_t severity, const Text &text);
    void say_left_out(size_t link, TextGate &gate, const char *what);

    Texts texts_[Board::max_ports];
};

/// Names of all fault bits in `faults`, joined by ", ".
Text fault_text(const char *prefix, uint32_t faults);

} // namespace omni
