// SPDX-License-Identifier: MIT
// The vector table as Teensyduino's start-up leaves it, and what becomes of it. The handlers are never run here: they
// are names.
#include <Arduino.h>

#include <initializer_list>

#include "boards/teensy40/faults.h"

extern "C" {

void (*volatile _VectorsRam[NVIC_NUM_INTERRUPTS + 16])();
volatile uint32_t *omni_fault_register;
uint32_t omni_fault_mask;
omni_fault_write_t omni_fault_writes[OMNI_FAULT_WRITES];
void omni_on_fault() {}
void unused_interrupt_vector() {
    omni_fault_mask = 0; // unlike the others, or the linker may fold them
}
}

namespace {

uint32_t pin_register;
void somebodys() {
    pin_register = 1;
}

constexpr int pendsv = 14, systick = 15, temperature_panic = 16 + IRQ_TEMPERATURE_PANIC, usb = 16 + 113;

} // namespace

extern "C" {

void vectors_start_up() {
    for (auto &vector : _VectorsRam) {
        vector = unused_interrupt_vector;
    }
    for (const int taken : {pendsv, systick, temperature_panic, usb}) {
        _VectorsRam[taken] = somebodys;
    }
}
void vectors_set_on_fault(uint32_t mask) {
    omni::set_on_fault(&pin_register, mask);
}
/// 'u' unused, 'f' the handler that drops the outputs, 's' somebody's own.
char vector(int exception) {
    const auto function = _VectorsRam[exception];
    return function == omni_on_fault ? 'f' : (function == unused_interrupt_vector ? 'u' : 's');
}
/// A robot whose motors hang on the processor's pins, without an output-enable pin.
void vectors_on_fault(uint32_t value) {
    omni::on_fault(&pin_register, value);
}
/// What the n-th write does; 0 if it is none.
uint32_t vectors_write(int number) {
    return omni_fault_writes[number].address == &pin_register ? omni_fault_writes[number].value : 0;
}
uint32_t vectors_mask() {
    return omni_fault_register == &pin_register ? omni_fault_mask : 0;
}
}
