// SPDX-License-Identifier: MIT
/// @file startup.cpp  From reset to main(): vectors, stack paint, FPU, memory protection, .data, .bss, constructors,
/// arguments.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>

#include "base/machine.h"
#include "base/semihosting.h"
#include "base/stack.h"

int main(int argc, char **argv);

extern "C" {

extern uint32_t an500_stack_limit[];
extern uint32_t an500_stack_top[];
extern uint32_t an500_data_begin[];
extern uint32_t an500_data_end[];
extern const uint32_t an500_data_image[];
extern uint32_t an500_bss_begin[];
extern uint32_t an500_bss_end[];
extern void (*const an500_init_begin[])();
extern void (*const an500_init_end[])();

void an500_reset();
void an500_start();
void an500_fault_entry() noexcept;

// Interrupts end in the fault report unless the program defines them.
#define OMNI_WEAK_HANDLER(name) [[gnu::weak, gnu::alias("an500_fault_entry")]] void name() noexcept
OMNI_WEAK_HANDLER(nmi_handler);
OMNI_WEAK_HANDLER(systick_handler);
OMNI_WEAK_HANDLER(uart0_rx_handler);
OMNI_WEAK_HANDLER(uart0_tx_handler);
OMNI_WEAK_HANDLER(uart1_rx_handler);
OMNI_WEAK_HANDLER(uart1_tx_handler);
OMNI_WEAK_HANDLER(uart2_rx_handler);
OMNI_WEAK_HANDLER(uart2_tx_handler);
OMNI_WEAK_HANDLER(uart3_rx_handler);
OMNI_WEAK_HANDLER(uart3_tx_handler);
OMNI_WEAK_HANDLER(uart4_rx_handler);
OMNI_WEAK_HANDLER(timer0_handler);

using Handler = void (*)();
constexpr Handler none = an500_fault_entry;

[[gnu::section(".vectors"), gnu::used]] const Handler an500_vectors[16 + 32] = {
    reinterpret_cast<Handler>(an500_stack_top), an500_reset, nmi_handler, none, none, none, none, none, none, none,
    none, none, none, none, none, systick_handler,
    // interrupts 0 to 31
    uart0_rx_handler, uart0_tx_handler, uart1_rx_handler, uart1_tx_handler, uart2_rx_handler, uart2_tx_handler, none,
    none, timer0_handler, none, none, none, none, none, none, none, none, none, uart3_rx_handler, uart3_tx_handler,
    uart4_rx_handler, none, none, none, none, none, none, none, none, none, none, none};

/// Paints the stack: in assembly, because C may use it.
[[gnu::naked]] void an500_reset() {
    asm volatile("ldr r0, =an500_stack_limit\n\t"
                 "ldr r1, =an500_stack_top\n\t"
                 "ldr r2, =0xA5A5A5A5\n"
                 "1: str r2, [r0], #4\n\t"
                 "cmp r0, r1\n\t"
                 "blo 1b\n\t"
                 "bl an500_start\n\t"
                 "b .");
}

/// Only one stack is used, so the pushed registers are at its top, if there was room for them. Faults have a stack of
/// their own.
[[gnu::naked]] void an500_fault_entry() noexcept {
    asm volatile("mov r0, sp\n\t"
                 "mrs r1, ipsr\n\t"
                 "ldr r2, =an500_fault_stack_top\n\t"
                 "mov sp, r2\n\t"
                 "b an500_take_fault");
}
}

namespace {

using an500::at;

/// A region of the memory protection unit, normal memory. @param access AP bits: 0 none, 6 read only.
void protect(uint32_t number, uint32_t address, uint32_t size_log2, uint32_t access) {
    constexpr uint32_t number_valid = 1u << 4;
    constexpr uint32_t normal = 0b110u << 16;
    at(0xE000ED9C) = address | number_valid | number;
    at(0xE000EDA0) = access << 24 | normal | (size_log2 - 1) << 1 | 1u;
}

void enable_fpu() {
    at(0xE000ED88) |= 0xFu << 20;
    asm volatile("dsb\n\tisb" : : : "memory");
}

/// Code is read-only, address 0 is not readable (null pointers), and a stack overflow faults.
void protect_memory() {
    constexpr uint32_t none = 0;
    constexpr uint32_t read_only = 6;
    protect(0, 0x00000000, 22, read_only);
    protect(1, 0x00000000, 8, none);
    protect(2, 0x1FFF0000, 16, none);
    at(0xE000ED94) = 0b101; // on, the rest as without it
    asm volatile("dsb\n\tisb" : : : "memory");
}

void set_up_memory() {
    const auto bytes = [](const uint32_t *begin, const uint32_t *end) {
        return static_cast<size_t>(end - begin) * sizeof(uint32_t);
    };
    std::memcpy(an500_data_begin, an500_data_image, bytes(an500_data_begin, an500_data_end));
    std::memset(an500_bss_begin, 0, bytes(an500_bss_begin, an500_bss_end));
}

int split(char *text, char **words, int capacity) {
    int count = 0;
    for (char *word = std::strtok(text, " "); word != nullptr && count < capacity; word = std::strtok(nullptr, " ")) {
        words[count++] = word;
    }
    return count;
}

} // namespace

extern "C" [[gnu::used]] void an500_start() {
    enable_fpu();
    set_up_memory();
    protect_memory();
    for (auto *init = an500_init_begin; init != an500_init_end; ++init) {
        (*init)();
    }
    static char line[1024];
    static char *arguments[64 + 1];
    if (!an500::semihosting_command_line(line, sizeof line)) {
        an500::semihosting_print("the command line is too long\n");
        an500::semihosting_exit(2);
    }
    const int count = split(line, arguments, 64);
    std::exit(main(count, arguments));
}
