// SPDX-License-Identifier: MIT
/// @file faults.h  Takes the motors' power away when the processor faults. Teensyduino's handler, which runs next, keeps a record of
/// the fault and then waits: the watchdog ends that.
#pragma once

#include <cstdint>

namespace omni {

/// From now on a fault writes `mask` to `register_address` before anything else.
void set_on_fault(volatile uint32_t *register_address, uint32_t mask);

} // namespace omni
