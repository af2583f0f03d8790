/* SPDX-License-Identifier: MIT */
/**
 * @file pins.h
 * The robot at the chip's pins: encoders, PWM chip with its output-enable pin or motors at PWM pins, stop button,
 * battery, gyro. The world goes on by 1 ms of the machine's time at a time. What its encoders counted in that
 * millisecond comes as edges, spread evenly over the next one.
 *
 * Faults of the world act at the wires. Those that no wire can show are refused: `encoder_invalid`, `encoder_bit`,
 * `clock_jump`, `clock_stuck`, `tick_late`. Faults of the pose sensor and the link are for whoever plays the ground
 * station.
 */
#ifndef HIL_SIM_RT1062_PINS_H
#define HIL_SIM_RT1062_PINS_H

#include <stdbool.h>
#include <stdint.h>

#include "hil_sim/rt1062.h"

/* Edges of a wheel's encoder in the millisecond under way. */
typedef struct rt_wheel_t {
    int32_t counts;    /* the world's, of which the pins know or will by the end of this millisecond */
    uint32_t position; /* of the pins: its lower two bits are the levels */
    int32_t edges;     /* of this millisecond; negative: backwards */
    uint32_t done;
} rt_wheel_t;

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
    uint64_t begin_ns; /* of the millisecond under way */
    rt_wheel_t wheel[HIL_MAX_WHEELS];
    rt_noise_t noise;
} rt_pins_t;

/* A pad's level changed; of interest if the robot looks at it. */
void rt_pins_level_changed(rt1062_t *m, uint32_t pad);
/* Voltage at a pad [V]. */
double rt_pins_voltage(rt1062_t *m, uint32_t pad);

#endif
