// SPDX-License-Identifier: MIT
/// @file fault.h  What the processor leaves behind when it faults.
#pragma once

#include <cstdint>

namespace an500 {

/// What the hardware pushed, and the fault status registers.
struct Fault {
    uint32_t r0, r1, r2, r3, r12, lr, pc, xpsr;
    uint32_t exception; ///< number: 2 NMI, 3 hard, 4 memory, 5 bus, 6 usage, others: an interrupt without a handler
    uint32_t cfsr, hfsr, mmfar, bfar;
};

/// Prints all of it on the console and ends the emulator with exit code fault_exit_code. A program may define its own.
extern "C" [[noreturn]] void an500_fault(const Fault &fault);

constexpr int fault_exit_code = 70;

/// Write the report that an500_fault prints. @param line called with one line at a time, without line feed.
void describe_fault(const Fault &fault, void (*line)(const char *text));

} // namespace an500
