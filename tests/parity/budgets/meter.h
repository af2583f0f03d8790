// SPDX-License-Identifier: MIT
/// @file meter.h  Counts instructions on QEMU's mps2-an500 and bytes of stack. Run QEMU with -icount shift=10: then an instruction
/// takes 1024 ns of the machine's time, 25.6 periods of the 25 MHz that the CMSDK timer counts, so that the count is exact.
#pragma once

#include <cstddef>
#include <cstdint>

namespace meter {

void start();

/// Instructions executed since start(), modulo 2^32 timer periods; a difference is good for 160 million.
uint32_t timer();

/// Instructions between two readings of timer(), the reading itself taken off.
uint32_t between(uint32_t begin, uint32_t end);

/// Paint the stack below the caller, `stack_reach` bytes.
void paint();

/// Deepest byte used since paint(), counted from the caller.
size_t depth();

constexpr size_t stack_reach = 8192;

} // namespace meter
