// SPDX-License-Identifier: MIT
/// @file stopwatch.h  What a program's work costs: nanoseconds of CPU time on a PC, instructions on the emulated
/// Cortex-M7 (run with icount).
#pragma once

#include <cstdint>

#ifdef __arm__
#include "meter.h"
#else
#include <ctime>
#endif

namespace stopwatch {

#ifdef __arm__
inline void start() {
    meter::start();
}
inline uint64_t now() {
    return meter::timer();
}
inline uint32_t between(uint64_t begin, uint64_t end) {
    return meter::between(static_cast<uint32_t>(begin), static_cast<uint32_t>(end));
}
#else
inline void start() {}
inline uint64_t now() {
    timespec time{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return static_cast<uint64_t>(time.tv_sec) * 1000000000u + static_cast<uint64_t>(time.tv_nsec);
}
inline uint32_t between(uint64_t begin, uint64_t end) {
    return static_cast<uint32_t>(end - begin);
}
#endif

} // namespace stopwatch
