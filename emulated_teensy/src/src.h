/* SPDX-License-Identifier: MIT */
/**
 * @file src.h
 * SRC: why the chip was reset, and registers that outlive all but a power-on.
 */
#ifndef EMULATED_TEENSY_SRC_H
#define EMULATED_TEENSY_SRC_H

#include <stdint.h>

#include "emulated_teensy/rt1062.h"

enum { RT_SRC_GPRS = 10 };

typedef struct rt_src_t {
    uint32_t scr;
    uint32_t srsr;
    uint32_t gpr[RT_SRC_GPRS]; /* SRC_GPR1 .. 10 */
} rt_src_t;

#endif
