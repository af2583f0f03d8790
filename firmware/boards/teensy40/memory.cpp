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
/// Scanned first: five times what the stack can take (docs/concepts/teensy.md). All of it takes half a tick.
constexpr uintptr_t depth = 32 * 1024;
constexpr uintptr_t gap = 4 * 1024; ///< larger than any frame, so that a deeper stack marks it

/// The addresses are numbers here: the compiler must not reason about the objects that the linker's symbols seem to be.
volatile uint32_t *lowest() {
    return reinterpret_cast<volatile uint32_t *>(reinterpret_cast<uintptr_t>(&_ebss) + guard);
}

/// @return the address of the first word from `begin` on that is not painted, or `end`.
uintptr_t first_used(uintptr_t begin, uintptr_t end) {
    uintptr_t at = begin & ~uintptr_t{3};
    while (at < end && *reinterpret_cast<const volatile uint32_t *>(at) == paint) {
        at += sizeof(uint32_t);
    }
    return at < end ? at : end;
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
    const auto bottom = reinterpret_cast<uintptr_t>(lowest());
    const uintptr_t begin = here - depth;
    const bool shallow = begin > bottom && first_used(begin, begin + gap) == begin + gap;
    const uintptr_t word = first_used(shallow ? begin : bottom, here);
    MemoryFree free;
    free.stack = static_cast<uint32_t>(word - bottom);
    free.heap = static_cast<uint32_t>(reinterpret_cast<uintptr_t>(&_heap_end) - reinterpret_cast<uintptr_t>(__brkval));
    return free;
}

} // namespace omni
