/* SPDX-License-Identifier: MIT */
/**
 * @file flexspi.h
 * FlexSPI1, the controller of the flash chip, as eeprom.c of the core uses it: commands from the look-up table, data
 * through the two FIFOs. The memory at 0x60000000 is not read through it but mapped.
 */
#ifndef EMULATED_TEENSY_FLEXSPI_H
#define EMULATED_TEENSY_FLEXSPI_H

#include <stdbool.h>
#include <stdint.h>

#include "emulated_teensy/rt1062.h"

enum { RT_FLEXSPI_STORED = 12, RT_FLEXSPI_LUT = 64, RT_FLEXSPI_WINDOW = 128, RT_FLEXSPI_FIFO = 1024 };

typedef struct rt_flexspi_t {
    uint32_t stored[RT_FLEXSPI_STORED];
    uint32_t lut[RT_FLEXSPI_LUT];
    uint32_t lut_control;                 /* LUTCR */
    bool key_given;                       /* LUTKEY was the last write: LUTCR may be written */
    uint32_t interrupts;                  /* INTR, IPTXWE and IPRXWA apart */
    uint8_t tx_window[RT_FLEXSPI_WINDOW]; /* TFDR0 .. 31 */
    uint8_t tx[RT_FLEXSPI_FIFO];
    uint32_t tx_count;
    uint8_t rx[RT_FLEXSPI_WINDOW]; /* RFDR0 .. 31 */
    uint32_t rx_count;
    bool busy;        /* a command is on the wire, or waits for data */
    uint64_t done_ns; /* when the wire is through with it; RT_NEVER: it waits for data */
} rt_flexspi_t;

/* What the boot ROM leaves here, for the flash chip's configuration block at `block`. */
void rt_flexspi_after_rom(rt1062_t *m, const uint8_t *block);

#endif
