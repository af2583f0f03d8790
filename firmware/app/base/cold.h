// SPDX-License-Identifier: MIT
/// @file cold.h  Where code goes that no tick runs.
#pragma once

/// In front of a function: leave it in flash memory. A Teensy copies all other code into ITCM, which answers at once
/// and is small. Code in flash runs through the processor's cache. For what only the background calls, and nobody waits
/// for.
#ifdef __IMXRT1062__
#define OMNI_COLD __attribute__((section(".flashmem"), noinline))
#else
#define OMNI_COLD
#endif
