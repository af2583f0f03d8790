// SPDX-License-Identifier: MIT
#include "boards/teensy40/faults.h"

extern "C" {
// Written if no register was set.
static uint32_t nothing;
volatile uint32_t *omni_fault_register = &nothing;
uint32_t omni_fault_mask = 0;
omni_fault_write_t omni_fault_writes[OMNI_FAULT_WRITES] = {{&nothing, 0}, {&nothing, 0}, {&nothing, 0}, {&nothing, 0},
                                                           {&nothing, 0}, {&nothing, 0}, {&nothing, 0}, {&nothing, 0},
                                                           {&nothing, 0}, {&nothing, 0}, {&nothing, 0}, {&nothing, 0},
                                                           {&nothing, 0}, {&nothing, 0}, {&nothing, 0}, {&nothing, 0}};

/// Leaves stack and link register as the processor set them: the next handler looks there for the cause.
__attribute__((naked)) void omni_on_fault() {
    __asm__ volatile("movw r0, #:lower16:omni_fault_register\n\t"
                     "movt r0, #:upper16:omni_fault_register\n\t"
                     "ldr r0, [r0]\n\t"
                     "movw r1, #:lower16:omni_fault_mask\n\t"
                     "movt r1, #:upper16:omni_fault_mask\n\t"
                     "ldr r1, [r1]\n\t"
                     "str r1, [r0]\n\t"
                     "movw r0, #:lower16:omni_fault_writes\n\t"
                     "movt r0, #:upper16:omni_fault_writes\n\t"
                     ".rept 16\n\t" // OMNI_FAULT_WRITES
                     "ldmia r0!, {r1, r2}\n\t"
                     "str r2, [r1]\n\t"
                     ".endr\n\t"
                     "b unused_interrupt_vector");
}
}
