/* SPDX-License-Identifier: MIT */
/**
 * @file pins.h
 * The circuit at the chip's pins: encoders, PWM and output-enable pins, stop button, battery, I2C buses. It is stepped
 * with the chip's time. What its encoders counted in a step comes as edges, spread evenly over the next one.
 */
#ifndef EMULATED_TEENSY_PINS_H
#define EMULATED_TEENSY_PINS_H

#include <stdbool.h>
#include <stdint.h>

#include "emulated_teensy/rt1062.h"

/* Edges of an encoder in the step under way. */
typedef struct rt_disc_t {
    int32_t counts;    /* the circuit's at the end of the last step; the pins follow during this one */
    uint32_t position; /* of the pins: its lower two bits are the levels */
    int32_t edges;     /* of this step; negative: backwards */
    uint32_t done;
} rt_disc_t;

/* A loose wire at an encoder's pin: the disc's levels don't come, but edges at random times. */
typedef struct rt_noise_t {
    bool on;
    uint32_t pad;
    uint32_t mean_ns; /* between two edges, which are half to one and a half of it apart */
    uint64_t edges;
    uint64_t next_ns; /* when the next edge comes */
} rt_noise_t;

typedef struct rt_pins_t {
    bool connected;
    uint64_t begin_ns; /* of the step under way */
    rt_disc_t disc[RT1062_ENCODERS];
    rt_noise_t noise;
} rt_pins_t;

/* A pad's level changed: the circuit is told if it is the output-enable pin. */
void rt_pins_level_changed(rt1062_t *m, uint32_t pad);
/* Voltage at a pad [V]. */
double rt_pins_voltage(rt1062_t *m, uint32_t pad);

#endif
