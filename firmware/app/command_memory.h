// SPDX-License-Identifier: MIT
/// @file command_memory.h  Numbered commands that came, and how many stops came since: what a repetition may still do.
///
/// A repetition has COMMAND_LONG.confirmation above 0. Its first copy may have been executed, and its answer lost. Or
/// the first copy itself was lost. In both cases somebody may have stopped the robot since, and a stop counts more
/// than what was asked before it.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/links.h"

namespace omni {

class CommandMemory {
public:
    /// The latest commands that are remembered, and at most how many of them of one sender: a busy one must not push
    /// out those of others.
    static constexpr size_t most = 32;
    static constexpr size_t most_per_sender = 8;
    /// A sender repeats a command for at most this long. The host tools try ten times, once a second, and may begin
    /// anew up to five seconds later.
    static constexpr uint64_t repeating_us = 15'000'000;

    /// Two copies of one command are equal in all of these.
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
        executed,  ///< this very command was accepted before
        overtaken, ///< a stop has come since its first copy, or may have
    };

    /// A copy of a numbered command has come. @param repeated its sender has sent it before. @param begins it would
    /// begin a motion or release a stop: one that was overtaken must not be executed.
    Verdict take(const Key &key, bool repeated, bool begins, uint64_t now_us);
    /// It was executed and accepted.
    void accepted(const Key &key);
    /// Somebody has stopped the robot or had it hold.
    void stopped(const Sender &by, uint64_t now_us);

private:
    struct Entry {
        Key key;
        uint32_t order = 0; ///< of its latest copy; 0: free
        uint32_t stops = 0; ///< that had come before its first copy
        bool accepted = false;
    };
    /// @return its place, or the one that is to be used for it.
    Entry &find(const Key &key);
    bool may_be_overtaken(const Sender &sender, uint64_t now_us) const;

    Entry entries_[most];
    uint32_t order_ = 0;
    uint32_t stops_ = 0;
    Sender stopper_; ///< of the latest stop
    uint64_t stopped_us_ = 0;
};

} // namespace omni
