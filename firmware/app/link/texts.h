// SPDX-License-Identifier: MIT
/// @file texts.h  STATUSTEXT: news for every link, refusals for whoever asked. Both are limited in rate, per link.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/robot_clock.h"
#include "app/base/text.h"
#include "app/link/links.h"
#include "app/link/mavlink_types.h"
#include "app/link/text_gate.h"

namespace omni {

class Texts {
public:
    static constexpr size_t nobody = Board::max_ports;

    Texts(Links &links, const RobotClock &clock) : links_(links), clock_(clock) {}

    /// A message of this link is being seen to: refusals go there. @param link or `nobody`.
    void set_asker(size_t link) { asker_ = link; }
    /// Send a STATUSTEXT on every link, at most two a second after a burst. @param severity MAV_SEVERITY.
    void say(uint8_t severity, const Text &text);
    /// The same on one link.
    void say_on(size_t link, uint8_t severity, const Text &text);
    /// Tell whoever asked why not: on that link only, at most one a second after a burst. Everybody's business if
    /// nobody asked.
    void refuse(uint8_t severity, const Text &text);
    /// The same for what is streamed, at most once a second. @param said_us when it was last said on each link; 0: not
    /// yet.
    void refuse_streamed(uint64_t (&said_us)[Board::max_ports], const Text &text);
    /// Say how many texts were left out, where there were any.
    void say_left_out();

private:
    /// What a link was not told.
    struct Gates {
        TextGate news = TextGate(500'000);
        TextGate refusals = TextGate(1'000'000);
    };
    void send(size_t link, TextGate &gate, uint8_t severity, const Text &text);
    void say_left_out(size_t link, TextGate &gate, const char *what);

    Links &links_;
    const RobotClock &clock_;
    size_t asker_ = nobody;
    Gates gates_[Board::max_ports];
};

/// Names of all fault bits in `faults`, joined by ", ".
Text fault_text(const char *prefix, uint32_t faults);

} // namespace omni
