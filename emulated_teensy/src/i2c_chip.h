/* SPDX-License-Identifier: MIT */
/**
 * @file i2c_chip.h
 * The chips on a bus, as one I2C target: it follows the levels of the two lines (NXP UM10204), whichever controller or
 * pin moves them, and passes START, bytes and STOP to the circuit.
 */
#ifndef EMULATED_TEENSY_I2C_CHIP_H
#define EMULATED_TEENSY_I2C_CHIP_H

#include <stdbool.h>
#include <stdint.h>

#include "emulated_teensy/rt1062.h"

typedef struct rt_i2c_chip_t {
    bool scl; /* as seen last */
    bool sda;
    bool listens; /* between START and STOP, and still addressed */
    bool reads;   /* it is the chip that sends bytes */
    bool address; /* the byte under way is the first one */
    bool acknowledges;
    uint8_t bit; /* clocks of this byte so far, 9: the acknowledge's */
    uint8_t byte;
    bool pulls;     /* the chip holds SDA low */
    bool stuck_sda; /* a fault of the circuit does */
    bool stuck_scl;
} rt_i2c_chip_t;

/* The levels of this bus's lines changed. */
void rt_i2c_chip_lines(rt1062_t *m, uint32_t number, bool scl, bool sda);
/* Each line is held low by a fault, or let go. */
void rt_i2c_chip_stuck(rt1062_t *m, uint32_t number, bool scl, bool sda);

#endif
