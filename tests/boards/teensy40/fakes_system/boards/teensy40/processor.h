// SPDX-License-Identifier: MIT
// Takes the place of the board's header of the same name.
#pragma once

#include <Arduino.h>

namespace omni {

struct InterruptLock {
    InterruptLock();
    ~InterruptLock();
};
const arm_fault_info_struct *fault_info();
const uint8_t *flash_memory(uint32_t address);
[[noreturn]] void system_reset();

} // namespace omni
