// SPDX-License-Identifier: MIT
/// @file check.h  What every fuzzer uses to report: a broken promise ends the process, figures are printed when it ends
/// well.
#pragma once

#include <cstdint>

namespace fuzz {

/// What this process has done so far.
struct Figures {
    uint64_t executions = 0;
    uint64_t bytes = 0;  ///< handed to the code under test
    uint64_t frames = 0; ///< parser: frames found; App: frames the robot sent
    uint64_t ticks = 0;
    uint64_t armed_ticks = 0;   ///< ticks with the bridges switched on
    uint64_t driving_ticks = 0; ///< ticks with some motor driven
    uint64_t stops = 0;         ///< Sequence: stops whose effect was watched
    uint64_t stops_in_motion = 0;
};

/// Printed on standard output at exit, as one line of JSON.
Figures &figures();

/// Say what was promised and abort, so that the engine keeps the input.
[[noreturn]] void broken(const char *promise, long detail);

inline void check(bool holds, const char *promise, long detail = 0) {
    if (!holds) {
        broken(promise, detail);
    }
}

} // namespace fuzz
