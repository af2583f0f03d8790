// SPDX-License-Identifier: MIT
/// @file meter.h  Counts instructions on QEMU's mps2-an500. Run QEMU with -icount shift=10: then an instruction takes
/// 1024 ns of the machine's time. These are 25.6 periods of the 25 MHz that its timers count, so the count is exact.
#pragma once

#include <cstdint>

namespace meter {

void start();

/// The timer, which counts down.
uint32_t timer();

/// Instructions between two readings of timer(), the reading itself taken off; good for 160 million.
uint32_t between(uint32_t begin, uint32_t end);

} // namespace meter
