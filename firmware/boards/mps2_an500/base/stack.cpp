// SPDX-License-Identifier: MIT
#include "base/stack.h"

extern "C" {
extern uint32_t an500_stack_limit[]; ///< lowest address
extern uint32_t an500_stack_top[];
}

namespace an500 {
namespace {

/// What repaint_stack() itself may need.
constexpr size_t margin_words = 16;

uint32_t *stack_pointer() {
    uint32_t *pointer = nullptr;
    asm volatile("mov %0, sp" : "=r"(pointer));
    return pointer;
}

size_t bytes_from(const uint32_t *pointer) {
    return static_cast<size_t>(an500_stack_top - pointer) * sizeof(uint32_t);
}

} // namespace

size_t stack_size() {
    return bytes_from(an500_stack_limit);
}

size_t stack_used() {
    const uint32_t *word = an500_stack_limit;
    while (word < an500_stack_top && *word == stack_paint) {
        ++word;
    }
    return bytes_from(word);
}

void repaint_stack() {
    const uint32_t *end = stack_pointer() - margin_words;
    for (volatile uint32_t *word = an500_stack_limit; word < end; ++word) {
        *word = stack_paint;
    }
}

size_t stack_depth() {
    return bytes_from(stack_pointer());
}

} // namespace an500
