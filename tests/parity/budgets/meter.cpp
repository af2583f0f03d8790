// SPDX-License-Identifier: MIT
#include "meter.h"

namespace meter {
namespace {

// CMSDK APB timer 0 (Arm Cortex-M System Design Kit TRM, 4.3): counts down at the system clock.
volatile uint32_t *const ctrl = reinterpret_cast<volatile uint32_t *>(0x40000000);
volatile uint32_t *const value = reinterpret_cast<volatile uint32_t *>(0x40000004);
volatile uint32_t *const reload = reinterpret_cast<volatile uint32_t *>(0x40000008);

constexpr uint32_t periods_per_5 = 128; ///< of the timer in five instructions: 5 * 1024 ns / 40 ns
constexpr uint32_t pattern = 0xA5C3F00D;
constexpr size_t spared = 256; ///< bytes below the caller that painting itself needs

uint32_t overhead = 0;

uint32_t instructions(uint32_t begin, uint32_t end) {
    return static_cast<uint32_t>((static_cast<uint64_t>(begin - end) * 5 + periods_per_5 / 2) / periods_per_5);
}

} // namespace

void start() {
    *ctrl = 0;
    *reload = 0xFFFFFFFF;
    *value = 0xFFFFFFFF;
    *ctrl = 1;
    const uint32_t begin = timer();
    const uint32_t end = timer();
    overhead = instructions(begin, end);
}

__attribute__((noinline)) uint32_t timer() {
    return *value;
}

uint32_t between(uint32_t begin, uint32_t end) {
    return instructions(begin, end) - overhead;
}

__attribute__((noinline)) void paint() {
    auto *top = static_cast<uint32_t *>(__builtin_frame_address(0)) - spared / sizeof(uint32_t);
    for (volatile uint32_t *word = top - stack_reach / sizeof(uint32_t); word < top; word = word + 1) {
        *word = pattern;
    }
}

__attribute__((noinline)) size_t depth() {
    auto *frame = static_cast<uint32_t *>(__builtin_frame_address(0));
    const volatile uint32_t *word = frame - (spared + stack_reach) / sizeof(uint32_t);
    while (word < frame && *word == pattern) {
        word = word + 1;
    }
    return reinterpret_cast<uintptr_t>(frame) - reinterpret_cast<uintptr_t>(word);
}

} // namespace meter
