// SPDX-License-Identifier: MIT
/// @file action.h  An input as a list of whole actions, and mutations that keep it one. What a search changes is what
/// is done, on which link and in which order, never half of it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace fuzz {

/// What one action does; sequence.h says how. Any byte is one of them, modulo their number.
enum class Kind : uint8_t {
    ticks,
    host_ticks,
    arm,
    disarm,
    estop,
    release,
    drive,
    fixes,
    heartbeat,
    enter_hil,
    leave_hil,
    reboot,
    power_cut,
    parameter,
    trajectory,
    message,
    noise,
    half,
    connect,
    bus,
    clock_jump,
    silence,
    storage,
    key,
    scan,
    list,
    count,
};

/// Eight bytes, so that a cut anywhere in an input leaves the actions before it as they are.
struct Action {
    uint8_t kind;
    uint8_t link;
    uint8_t a; ///< variant of the action
    uint8_t b;
    uint16_t n; ///< how often or how much
    int16_t x;

    Kind what() const { return static_cast<Kind>(kind % static_cast<uint8_t>(Kind::count)); }
};
static_assert(sizeof(Action) == 8, "an action has no gaps");

using Actions = std::vector<Action>;

/// The first one is the set-up of the run. Bytes that are no whole action are left out.
Actions actions_of(const uint8_t *data, size_t size);

/// Insert, delete, duplicate, swap, move to another link, change one field of an action: one to four of these.
/// @param data an input of `size` bytes with room for `capacity`. @return its new size.
size_t mutate_actions(uint8_t *data, size_t size, size_t capacity, uint64_t seed);

/// The beginning of one list and the end of another. @return bytes in `out`, `capacity` at most.
size_t cross_actions(const Actions &first, const Actions &second, uint8_t *out, size_t capacity, uint64_t seed);

} // namespace fuzz
