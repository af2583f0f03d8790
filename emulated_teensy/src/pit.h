/* SPDX-License-Identifier: MIT */
/**
 * @file pit.h
 * Periodic interrupt timer, four channels (i.MX RT1060 RM, chapter PIT). Chained channels and the 64-bit lifetime
 * timer are not modelled.
 */
#ifndef EMULATED_TEENSY_PIT_H
#define EMULATED_TEENSY_PIT_H

#include <stdbool.h>
#include <stdint.h>

enum { RT_PIT_CHANNELS = 4 };

typedef struct rt_pit_channel_t {
    uint32_t load;     /* LDVAL: takes effect when the channel is enabled, or expires */
    uint32_t control;  /* TCTRL */
    bool flag;         /* TFLG */
    uint64_t counts;   /* of the period under way */
    uint64_t begin_ns; /* of the first of `periods` equal periods */
    uint64_t periods;  /* which one is under way, 1 the first */
} rt_pit_channel_t;

typedef struct rt_pit_t {
    uint32_t control; /* MCR */
    rt_pit_channel_t channel[RT_PIT_CHANNELS];
} rt_pit_t;

#endif
