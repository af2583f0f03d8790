// SPDX-License-Identifier: MIT
/// @file faults.h  Removes motor power on a processor fault, an unexpected interrupt or over-temperature. Teensyduino's
/// handler, which runs next, records the fault and then waits until the watchdog resets.
#pragma once

#include <cstdint>

namespace omni {

/// From now on a fault writes `mask` to `register_address` before anything else. A handler
/// attached later replaces its vector as usual.
void set_on_fault(volatile uint32_t *register_address, uint32_t mask);

/// After that a fault writes `value` to `address`, too, in the order of the calls. At most OMNI_FAULT_WRITES.
void on_fault(volatile uint32_t *address, uint32_t value);

} // namespace omni

enum { OMNI_FAULT_WRITES = 16 };

extern "C" {
struct omni_fault_write_t {
    volatile uint32_t *address;
    uint32_t value;
};
// Read by the assembly of the handler, fault_entry.cpp.
extern volatile uint32_t *omni_fault_register;
extern uint32_t omni_fault_mask;
extern omni_fault_write_t omni_fault_writes[OMNI_FAULT_WRITES];
void omni_on_fault();
}
