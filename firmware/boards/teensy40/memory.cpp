// SPDX-License-Identifier: MIT
#include "boards/teensy40/memory.h"

#include <cstdint>

// Of Teensyduino's linker script and start-up.
extern "C" {
extern uint32_t _ebss;
extern uint32_t _heap_end;
extern char *__brkval;
}

namespace omni {
namespace {

constexpr uint32_t paint = 0xC5C5C5C5;
constexpr uintptr_t guard = 32;     ///< bytes that the memory protection unit watches, from _ebss on
constexpr uintptr_t distance = 256; ///< from the function that paints

/// The addresses are numbers here: the compiler must not reason about the objects that the linker's symbols seem to be.
volatile uint32_t *lowest() {
    return reinterpret_cast<volatile uint32_t *>(reinterpret_cast<uintptr_t>(&_ebss) + guard);
}

} // namespace

void paint_stack() {
    const auto here = reinterpret_cast<uintptr_t>(__builtin_frame_address(0));
    for (volatile uint32_t *word = lowest(); reinterpret_cast<uintptr_t>(word) < here - distance; ++word) {
        *word = paint;
    }
}

MemoryFree memory_free() {
    const auto here = reinterpret_cast<uintptr_t>(__builtin_frame_address(0));
    const volatile uint32_t *word = lowest();
    while (reinterpret_cast<uintptr_t>(word) < here && *word == paint) {
        ++word;
    }
    MemoryFree free;
    free.stack = static_cast<uint32_t>(reinterpret_cast<uintptr_t>(word) - reinterpret_cast<uintptr_t>(lowest()));
    free.heap = static_cast<uint32_t>(reinterpret_cast<uintptr_t>(&_heap_end) - reinterpret_cast<uintptr_t>(__brkval));
    return free;
}

} // namespace omni
