/* SPDX-License-Identifier: MIT */
/**
 * @file start.c
 * Reset of QEMU's mps2-an500 (Cortex-M7, Arm application note 500) for programs that are an ordinary main() on the C library's
 * semihosting: switches the FPU on and hands over to newlib's start-up code. Floating point is left as it comes out of reset: round
 * to nearest, denormals kept, NaNs propagated.
 */
#include <stdint.h>

extern uint32_t __stack; /* linker script */
extern void _start(void);

#define CPACR (*(volatile uint32_t *)0xE000ED88u) /* Armv7-M ARM B3.2.20 */

static void reset(void) {
    CPACR |= 0xFu << 20; /* full access to CP10 and CP11 */
    __asm__ volatile("dsb\n\tisb");
    _start();
}

/* Anything unexpected ends the program with an error: SYS_EXIT_EXTENDED, ADP_Stopped_RunTimeErrorUnknown, code 3. */
static void fault(void) {
    static const uint32_t why[] = {0x20023u, 3u};
    register uint32_t operation __asm__("r0") = 0x20u;
    register const uint32_t *parameter __asm__("r1") = why;
    __asm__ volatile("bkpt 0xab" : : "r"(operation), "r"(parameter) : "memory");
}

/* Entry 0 is the initial stack pointer, the others are handlers. */
__attribute__((section(".vectors"), used)) static const void *const vectors[16] = {
    &__stack, (const void *)reset, (const void *)fault, (const void *)fault,
    (const void *)fault, (const void *)fault, (const void *)fault,
};
