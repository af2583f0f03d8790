/* SPDX-License-Identifier: MIT */
/**
 * @file snvs.h
 * SNVS: the real-time clock. Its low-power part keeps running over any reset but a power-on: a Teensy 4.0 has no
 * battery at VBAT.
 */
#ifndef EMULATED_TEENSY_SNVS_H
#define EMULATED_TEENSY_SNVS_H

#include <stdint.h>

#include "emulated_teensy/rt1062.h"

/* A counter of 47 bits at 32.768 kHz. */
typedef struct rt_rtc_t {
    uint64_t count; /* at from_ns, or while it stands */
    uint64_t from_ns;
    uint32_t control; /* HPCR or LPCR */
} rt_rtc_t;

typedef struct rt_snvs_t {
    rt_rtc_t high; /* HPRTC: with the processor */
    rt_rtc_t low;  /* LPSRTC */
} rt_snvs_t;

#endif
