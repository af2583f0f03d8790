/* SPDX-License-Identifier: MIT */
/**
 * @file watchdog.h
 * WDOG3, the RT watchdog. WDOG1 and WDOG2 are off out of reset and the image does not touch them.
 */
#ifndef EMULATED_TEENSY_WATCHDOG_H
#define EMULATED_TEENSY_WATCHDOG_H

#include <stdbool.h>
#include <stdint.h>

#include "emulated_teensy/rt1062.h"

typedef struct rt_watchdog_t {
    uint32_t cs;
    uint32_t toval;
    uint32_t win;
    uint64_t count; /* at from_ns, or while it stands */
    uint64_t from_ns;
    bool open; /* unlocked */
    uint64_t open_until_ns;
    uint32_t written; /* in this window: bit 0 CS, 1 TOVAL, 2 WIN */
    uint32_t new_cs;
    uint32_t new_toval;
    uint32_t new_win;
    uint32_t half; /* first half of a 16-bit pair written to CNT, 0: none */
    uint64_t half_ns;
    uint64_t done_ns; /* when CS.RCS shows that a configuration has come through */
    bool biting;      /* the interrupt is out, the reset follows */
} rt_watchdog_t;

/* What the boot ROM leaves: off, open to be configured. */
void rt_watchdog_after_rom(rt1062_t *m);

#endif
