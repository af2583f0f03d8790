// SPDX-License-Identifier: MIT
#include "boards/teensy40/faults.h"

#include <Arduino.h>

#include <cstddef>

// Of Teensyduino's start-up, declared in no header: handles every exception and interrupt without a handler.
extern "C" void unused_interrupt_vector();

namespace omni {
namespace {

constexpr int first_exception = 2; ///< before it: initial stack pointer, reset
constexpr int first_interrupt = 16;

} // namespace

// Teensyduino has pointed every vector at its handler at start-up, but for the few that somebody asked for since. The
// temperature sensor's panic is one of those; its function does nothing but call that handler.
void set_on_fault(volatile uint32_t *register_address, uint32_t mask) {
    omni_fault_register = register_address;
    omni_fault_mask = mask;
    for (int exception = first_exception; exception < first_interrupt + NVIC_NUM_INTERRUPTS; ++exception) {
        if (_VectorsRam[exception] == unused_interrupt_vector) {
            _VectorsRam[exception] = omni_on_fault;
        }
    }
    _VectorsRam[first_interrupt + IRQ_TEMPERATURE_PANIC] = omni_on_fault;
}

void on_fault(volatile uint32_t *address, uint32_t value) {
    static size_t used = 0;
    if (used < OMNI_FAULT_WRITES) {
        omni_fault_writes[used++] = {address, value};
    }
    set_on_fault(omni_fault_register, omni_fault_mask); // the vectors, on a robot without an output-enable pin
}

} // namespace omni
