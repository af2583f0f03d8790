// SPDX-License-Identifier: MIT
/// @file processor.h  What needs the processor's own instructions or fixed addresses.
#pragma once

#include <Arduino.h>

#include <cstdint>

namespace omni {

/// Disables interrupts for the lifetime of an object; nests. For a few instructions only.
class InterruptLock {
public:
    InterruptLock() { __asm__ volatile("mrs %0, primask\n\tcpsid i" : "=r"(primask_)::"memory"); }
    ~InterruptLock() { __asm__ volatile("msr primask, %0" ::"r"(primask_) : "memory"); }
    InterruptLock(const InterruptLock &) = delete;
    InterruptLock &operator=(const InterruptLock &) = delete;

private:
    uint32_t primask_;
};

/// Teensyduino's fault record, in memory that survives a reset.
inline const arm_fault_info_struct *fault_info() {
    uint32_t address = 0x2027FF80;
    // Without this the compiler takes the fixed address for an out-of-bounds access.
    __asm__("" : "+r"(address));
    return reinterpret_cast<const arm_fault_info_struct *>(address);
}

/// Flash memory from `address` on, mapped into the processor's memory.
inline const uint8_t *flash_memory(uint32_t address) {
    return reinterpret_cast<const uint8_t *>(address);
}

[[noreturn]] inline void system_reset() {
    SCB_AIRCR = 0x05FA0004; // key, SYSRESETREQ
    for (;;) {}
}

} // namespace omni
