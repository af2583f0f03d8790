// SPDX-License-Identifier: MIT
/// @file flash_code.h  Placement of code that is not time-critical.
#pragma once

/// Function attribute: keep the code in flash. Why: a Teensy copies all other code into ITCM, which is fast and small.
/// Code in flash runs through the instruction cache. Only for background code without a deadline.
#ifdef __IMXRT1062__
#define OMNI_COLD __attribute__((section(".flashmem"), noinline))
#else
#define OMNI_COLD
#endif
