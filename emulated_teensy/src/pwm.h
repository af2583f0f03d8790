/* SPDX-License-Identifier: MIT */
/**
 * @file pwm.h
 * FlexPWM1..4 and quad timers 1..3, as far as pwm.c of the core uses them: what share of its period a pad is high. The
 * pulses themselves are not there, and no interrupt of these timers is.
 *
 * FlexPWM (RM, chapter eFlexPWM): values count from LDOK on; output A is high from VAL2 to VAL3, B from VAL4 to VAL5,
 * of INIT..VAL1. Quad timer (RM, chapter Quad Timer): output mode 6, high for CMPLD1 counts and low for 65537 - LOAD.
 */
#ifndef EMULATED_TEENSY_PWM_H
#define EMULATED_TEENSY_PWM_H

#include <stdbool.h>
#include <stdint.h>

#include "emulated_teensy/rt1062.h"

enum { RT_FLEXPWMS = 4, RT_SUBMODULES = 4, RT_SUBMODULE_WORDS = 0x30, RT_QUAD_TIMERS = 3, RT_QUAD_WORDS = 0x40 };

typedef struct rt_flexpwm_t {
    uint16_t control; /* MCTRL */
    uint16_t enabled; /* OUTEN */
    uint16_t written[RT_SUBMODULES][RT_SUBMODULE_WORDS];
    uint16_t loaded[RT_SUBMODULES][RT_SUBMODULE_WORDS];
} rt_flexpwm_t;

typedef struct rt_quad_timer_t {
    uint16_t words[RT_QUAD_WORDS]; /* four channels of 0x20 bytes */
} rt_quad_timer_t;

/* A timer's output at a pad. */
typedef struct rt_pulses_t {
    double share; /* of the period that it is high, 0..1 */
    double frequency_Hz;
} rt_pulses_t;

/* @return false if the pad is not at an output of a timer that runs. */
bool rt_pwm_pulses(const rt1062_t *m, uint32_t pad, rt_pulses_t *pulses);

#endif
