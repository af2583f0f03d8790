// SPDX-License-Identifier: MIT
#include "check.h"

#include <cstdio>
#include <cstdlib>

namespace fuzz {
namespace {

Figures counted;

void print_figures() {
    std::printf("{\"executions\": %llu, \"bytes\": %llu, \"frames\": %llu, \"ticks\": %llu, \"armed_ticks\": %llu, "
                "\"driving_ticks\": %llu, \"stops\": %llu, \"stops_in_motion\": %llu}\n",
                static_cast<unsigned long long>(counted.executions), static_cast<unsigned long long>(counted.bytes),
                static_cast<unsigned long long>(counted.frames), static_cast<unsigned long long>(counted.ticks),
                static_cast<unsigned long long>(counted.armed_ticks),
                static_cast<unsigned long long>(counted.driving_ticks), static_cast<unsigned long long>(counted.stops),
                static_cast<unsigned long long>(counted.stops_in_motion));
    std::fflush(stdout);
}

} // namespace

Figures &figures() {
    static const bool registered = std::atexit(print_figures) == 0;
    static_cast<void>(registered);
    return counted;
}

void broken(const char *promise, long detail) {
    std::printf("broken promise: %s (%ld)\n", promise, detail); // not on standard error, which may be silenced
    std::fflush(stdout);
    std::abort();
}

} // namespace fuzz
