// SPDX-License-Identifier: MIT
// Takes the place of the board's header of the same name.
#pragma once

#include <Arduino.h>

namespace omni {

void set_on_fault(volatile FakeSetRegister *register_address, uint32_t mask);

void on_fault(volatile uint32_t *address, uint32_t value);

} // namespace omni
