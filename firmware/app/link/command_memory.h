// SPDX-License-Identifier: MIT
/// @file command_memory.h  Deduplication of retransmitted commands, and invalidation by later stops.
///
/// A retransmission has COMMAND_LONG.confirmation > 0: either the acknowledgement or the first copy was lost. It must
/// not execute twice, and not after a stop that was received since the first copy.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/link/links.h"

namespace omni {

class CommandMemory {
public:
    /// Number of remembered commands, in total and per sender: one sender must not displace the others'.
    static constexpr size_t most = 32;
    static constexpr size_t most_per_sender = 8;
    /// Maximum time of retransmissions. The host tools retry ten times at 1 Hz, and may start again within 5 s.
    static constexpr uint64_t repeating_us = 15'000'000;

    /// Identity of a command.
    struct Key {
        Sender sender;
        uint16_t id = 0;
        int32_t receipt = 0;

        bool operator==(const Key &other) const {
            return sender == other.sender && id == other.id && receipt == other.receipt;
        }
    };
    enum class Verdict : uint8_t {
        execute,
        executed,  ///< already accepted: acknowledge only
        overtaken, ///< a stop has, or may have, been received since its first copy: deny
    };

    /// Decide on a copy of a numbered command. @param repeated it is a retransmission. @param begins it starts a motion
    /// or releases a stop.
    Verdict take(const Key &key, bool repeated, bool begins, uint64_t now_us);
    /// Record that a command was accepted.
    void accepted(const Key &key);
    /// Record a stop or hold.
    void stopped(const Sender &by, uint64_t now_us);

private:
    struct Entry {
        Key key;
        uint32_t order = 0; ///< sequence of its latest copy; 0: free entry
        uint32_t stops = 0; ///< number of stops before its first copy
        bool accepted = false;
    };
    /// Entry of this command, or the one to reuse for it.
    Entry &find(const Key &key);
    bool may_be_overtaken(const Sender &sender, uint64_t now_us) const;

    Entry entries_[most];
    uint32_t order_ = 0;
    uint32_t stops_ = 0;
    Sender stopper_; ///< of the latest stop
    uint64_t stopped_us_ = 0;
};

} // namespace omni
