// SPDX-License-Identifier: MIT
#include "boards/teensy40/faults.h"

#include <Arduino.h>

extern "C" {
void unused_interrupt_vector();
// Read by the assembly below.
volatile uint32_t *omni_fault_register = nullptr;
uint32_t omni_fault_mask = 0;

/// Leaves stack and link register as the processor set them: the next handler looks there for the cause.
__attribute__((naked)) static void on_fault() {
    __asm__ volatile("movw r0, #:lower16:omni_fault_register\n\t"
                     "movt r0, #:upper16:omni_fault_register\n\t"
                     "ldr r0, [r0]\n\t"
                     "movw r1, #:lower16:omni_fault_mask\n\t"
                     "movt r1, #:upper16:omni_fault_mask\n\t"
                     "ldr r1, [r1]\n\t"
                     "str r1, [r0]\n\t"
                     "b unused_interrupt_vector");
}
}

namespace omni {
namespace {

// Exception numbers of ARMv7-M: NMI, HardFault, MemManage, BusFault, UsageFault.
constexpr int first_fault = 2;
constexpr int last_fault = 6;

} // namespace

void set_on_fault(volatile uint32_t *register_address, uint32_t mask) {
    omni_fault_register = register_address;
    omni_fault_mask = mask;
    for (int exception = first_fault; exception <= last_fault; ++exception) {
        _VectorsRam[exception] = on_fault;
    }
}

} // namespace omni
