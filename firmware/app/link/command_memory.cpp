// SPDX-License-Identifier: MIT
#include "app/link/command_memory.h"

#include "app/base/flash_code.h"

namespace omni {

OMNI_COLD CommandMemory::Entry &CommandMemory::find(const Key &key) {
    size_t own = 0;
    Entry *oldest = entries_;
    Entry *oldest_own = nullptr;
    for (Entry &entry : entries_) {
        if (entry.order != 0 && entry.key == key) {
            return entry;
        }
        oldest = entry.order < oldest->order ? &entry : oldest;
        if (entry.order != 0 && entry.key.sender == key.sender) {
            oldest_own = oldest_own == nullptr || entry.order < oldest_own->order ? &entry : oldest_own;
            ++own;
        }
    }
    return own < most_per_sender ? *oldest : *oldest_own;
}

/// For a command whose first copy was lost: may the latest stop be newer than that copy? Not a stop by the sender
/// itself: its messages arrive in order, and it does not retransmit commands from before its stop.
OMNI_COLD bool CommandMemory::may_be_overtaken(const Sender &sender, uint64_t now_us) const {
    return stops_ > 0 && !(stopper_ == sender) && now_us - stopped_us_ <= repeating_us;
}

OMNI_COLD CommandMemory::Verdict CommandMemory::take(const Key &key, bool repeated, bool begins, uint64_t now_us) {
    Entry &entry = find(key);
    const bool known = entry.order != 0 && entry.key == key;
    if (!repeated || !known) {
        entry = {key, 0, stops_ - (repeated && may_be_overtaken(key.sender, now_us) ? 1 : 0), false};
    }
    entry.order = ++order_;
    if (repeated && begins && entry.stops != stops_) {
        return Verdict::overtaken;
    }
    return repeated && entry.accepted ? Verdict::executed : Verdict::execute;
}

OMNI_COLD void CommandMemory::accepted(const Key &key) {
    find(key).accepted = true;
}

OMNI_COLD void CommandMemory::stopped(const Sender &by, uint64_t now_us) {
    ++stops_;
    stopper_ = by;
    stopped_us_ = now_us;
}

} // namespace omni
