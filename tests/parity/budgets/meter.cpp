// SPDX-License-Identifier: MIT
#include "meter.h"

#include "base/machine.h"

namespace meter {
namespace {

// CMSDK APB timer 0 (Arm Cortex-M System Design Kit TRM, 4.3): counts down at the system clock.
constexpr uint32_t ctrl = 0x40000000;
constexpr uint32_t value = 0x40000004;
constexpr uint32_t reload = 0x40000008;

constexpr uint32_t periods_per_5 = 128; ///< of the timer in five instructions: 5 * 1024 ns / 40 ns

uint32_t overhead = 0;

uint32_t instructions(uint32_t begin, uint32_t end) {
    return static_cast<uint32_t>((static_cast<uint64_t>(begin - end) * 5 + periods_per_5 / 2) / periods_per_5);
}

} // namespace

void start() {
    an500::at(ctrl) = 0;
    an500::at(reload) = 0xFFFFFFFF;
    an500::at(value) = 0xFFFFFFFF;
    an500::at(ctrl) = 1;
    const uint32_t begin = timer();
    const uint32_t end = timer();
    overhead = instructions(begin, end);
}

__attribute__((noinline)) uint32_t timer() {
    return an500::at(value);
}

uint32_t between(uint32_t begin, uint32_t end) {
    return instructions(begin, end) - overhead;
}

} // namespace meter
