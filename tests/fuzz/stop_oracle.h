// SPDX-License-Identifier: MIT
/// @file stop_oracle.h  What must hold about stops, whatever else is said on whichever link: docs/reference/safety.md
/// as a model of four numbers. It knows only what reached the robot, never what the robot thinks of it.
///
/// - Within two ticks of a complete stop (disarm or emergency stop) no motor gets volts, and none does until somebody
/// arms.
/// - A robot that nobody armed since its last start moves nothing.
/// - An emergency stop is left by a release alone: arming does not count before, leaving host-in-the-loop or a reboot
/// neither.
/// - A stop is acknowledged as accepted on the link it came from.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "frames.h"

namespace fuzz {

class StopOracle {
public:
    /// Passes of the background in which the acknowledgement of a stop must come.
    static constexpr int ack_passes = 3;
    static constexpr unsigned ticks_to_rest = 2;
    static constexpr unsigned ticks_to_settle = 150;

    /// These were said to the robot; none of them has to be obeyed.
    void arm();
    void release() { latched_ = false; }
    /// A stop has reached the robot whole. @param latching an emergency stop.
    void stop(bool latching);
    /// It must be acknowledged with this receipt (result_param2) on this link.
    void expect_ack(size_t link, int32_t receipt) { acks_.push_back({link, receipt, ack_passes}); }
    void forget_acks(size_t link);
    /// The robot has started anew. @param latch_kept its memory worked, so that it knows about an emergency stop.
    void rebooted(bool latch_kept);

    /// The latest stop has surely been done and written down: a power cut does not undo it. A silent host in the loop
    /// delays it.
    bool settled() const { return host_ticks_ > ticks_to_rest || bench_ticks_ > ticks_to_settle; }

    void bench_ticked(bool moves);
    void host_ticked(bool moves);
    /// A frame that the robot sent.
    void heard(size_t link, const Found &frame);
    /// A pass of the background in which the robot read all that waited. @param deaf a bit per link that takes nothing
    /// from it.
    void pass(unsigned deaf);

    bool stopped() const { return !may_move_; }

private:
    struct Ack {
        size_t link;
        int32_t receipt;
        int passes;
    };
    void check_rest(unsigned ticks, bool moves) const;

    bool may_move_ = false;
    bool latched_ = false;
    unsigned bench_ticks_ = ticks_to_rest; ///< since it must rest
    unsigned host_ticks_ = ticks_to_rest;
    std::vector<Ack> acks_;
};

} // namespace fuzz
