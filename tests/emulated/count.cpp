// SPDX-License-Identifier: MIT
// What the tests of the bare board run: counts instructions, uses stack, faults on request.
#include <cstdio>
#include <cstring>

#include "base/machine.h"
#include "base/stack.h"

namespace {

/// Exactly 3 instructions per round and 1 before: mov, then subs, cmp, bne.
[[gnu::noinline]] void spin(uint32_t rounds) {
    asm volatile("mov r3, %0\n"
                 "1: subs r3, r3, #1\n\t"
                 "cmp r3, #0\n\t"
                 "bne 1b"
                 :
                 : "r"(rounds)
                 : "r3", "cc");
}

[[gnu::noinline]] void use_stack(size_t bytes) {
    volatile char *memory = static_cast<volatile char *>(__builtin_alloca(bytes));
    memory[0] = 1;
    memory[bytes - 1] = 2;
}

uint32_t ticks_of(uint32_t rounds) {
    const uint32_t begin = an500::clock_ticks();
    spin(rounds);
    return an500::clock_ticks() - begin;
}

} // namespace

int main(int argc, char **argv) {
    if (argc == 2 && std::strcmp(argv[1], "null") == 0) {
        volatile uint32_t *nothing = nullptr;
        return static_cast<int>(*nothing);
    }
    if (argc == 2 && std::strcmp(argv[1], "overflow") == 0) {
        use_stack(an500::stack_size());
    }
    an500::start_free_timer();
    const uint32_t ticks = ticks_of(20000) - ticks_of(10000);
    an500::repaint_stack();
    const size_t before = an500::stack_used();
    use_stack(10000);
    std::printf("%s ticks %lu stack %u %.3f\n", argv[argc - 1], static_cast<unsigned long>(ticks),
                static_cast<unsigned>(an500::stack_used() - before), 0.125);
    return argc;
}
