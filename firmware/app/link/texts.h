// SPDX-License-Identifier: MIT
/// @file texts.h  STATUSTEXT: events to all links, refusals to the requesting link. Both are rate-limited per link.
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
    Texts(Links &links, const RobotClock &clock) : links_(links), clock_(clock) {}

    /// Set the link whose message is being processed, for refusals. @param link or `no_link`.
    void set_requester(size_t link) { requester_ = link; }
    /// Send a STATUSTEXT on every link, at most two a second after a burst. @param severity MAV_SEVERITY.
    void say(uint8_t severity, const Text &text);
    /// Send a STATUSTEXT on one link, with the same rate limit.
    void send_to(size_t link, uint8_t severity, const Text &text);
    /// Send the reason of a refusal to the requesting link, at most one a second after a burst; to all links if there
    /// is no request.
    void refuse(uint8_t severity, const Text &text);
    /// Refusal of a streamed message, at most once a second. @param reported_us time of the last one on each link; 0:
    /// none.
    void refuse_rate_limited(uint64_t (&reported_us)[Board::max_ports], const Text &text);
    /// Report the number of suppressed texts, if any.
    void report_suppressed();

private:
    /// Rate limiters of a link.
    struct Gates {
        TextGate news = TextGate(500'000);
        TextGate refusals = TextGate(1'000'000);
    };
    void send(size_t link, TextGate &gate, uint8_t severity, const Text &text);
    void report_suppressed(size_t link, TextGate &gate, const char *what);

    Links &links_;
    const RobotClock &clock_;
    size_t requester_ = no_link;
    Gates gates_[Board::max_ports];
};

/// Names of all fault bits in `faults`, joined by ", ".
Text fault_text(const char *prefix, uint32_t faults);

} // namespace omni
