/* SPDX-License-Identifier: MIT */
/**
 * @file pads.h
 * The chip's pads between its inside and the wires: which function a pad has, who drives it, what level results. See
 * i.MX RT1060 RM, chapter IOMUXC. Register addresses and reset values are as in NXP's device header, alternatives and
 * daisy values as in NXP's fsl_iomuxc.h.
 *
 * Levels: 0, 1, or RT_FLOATING. Two drivers against one another give a finding, and low wins. An external pull is
 * stronger than the pad's own.
 */
#ifndef EMULATED_TEENSY_PADS_H
#define EMULATED_TEENSY_PADS_H

#include <stdbool.h>
#include <stdint.h>

#include "emulated_teensy/rt1062.h"

/* Numbers of pads: in the order of their registers. */
enum {
    RT_PAD_EMC = 0, /* GPIO_EMC_00 .. 41 */
    RT_PAD_AD_B0 = 42,
    RT_PAD_AD_B1 = 58,
    RT_PAD_B0 = 74,
    RT_PAD_B1 = 90,
    RT_PAD_SD_B0 = 106,
    RT_PAD_SD_B1 = 112,
    RT_PADS = 124,
    RT_NO_PAD = 255,
    RT_PAD_SCL = RT_PAD_AD_B1 + 0,   /* Teensy pin 19 */
    RT_PAD_SDA = RT_PAD_AD_B1 + 1,   /* Teensy pin 18 */
    RT_PAD_SCL3 = RT_PAD_AD_B1 + 7,  /* Teensy pin 16 */
    RT_PAD_SDA3 = RT_PAD_AD_B1 + 6,  /* Teensy pin 17 */
    RT_PAD_SCL4 = RT_PAD_AD_B0 + 12, /* Teensy pin 24 */
    RT_PAD_SDA4 = RT_PAD_AD_B0 + 13, /* Teensy pin 25 */
    RT_PAD_UART_TX = RT_PAD_AD_B0 + 2,
    RT_PAD_UART_RX = RT_PAD_AD_B0 + 3,
    RT_TEENSY_PINS = 40,
    RT_ALT_GPIO = 5,
    RT_FLOATING = -1
};

/* SELECT_INPUT registers: which of several pads a peripheral's input listens to. */
typedef enum rt_daisy_t {
    RT_DAISY_LPI2C1_SCL,
    RT_DAISY_LPI2C1_SDA,
    RT_DAISY_LPI2C3_SCL,
    RT_DAISY_LPI2C3_SDA,
    RT_DAISY_LPI2C4_SCL,
    RT_DAISY_LPI2C4_SDA,
    RT_DAISY_LPUART6_RX,
    RT_DAISY_LPUART6_TX,
    RT_DAISY_XBAR02,
    RT_DAISY_XBAR03,
    RT_DAISY_XBAR04,
    RT_DAISY_XBAR05,
    RT_DAISY_XBAR06,
    RT_DAISY_XBAR07,
    RT_DAISY_XBAR08,
    RT_DAISY_XBAR09,
    RT_DAISY_XBAR14,
    RT_DAISY_XBAR15,
    RT_DAISY_XBAR16,
    RT_DAISY_XBAR17,
    RT_DAISY_XBAR18,
    RT_DAISY_XBAR19,
    RT_DAISY_XBAR20,
    RT_DAISY_XBAR21,
    RT_DAISY_XBAR22,
    RT_DAISY_XBAR23,
    RT_DAISY_XBAR24,
    RT_DAISY_XBAR25,
    RT_DAISIES
} rt_daisy_t;

typedef struct rt_pads_t {
    uint32_t mux[RT_PADS];     /* SW_MUX_CTL_PAD */
    uint32_t control[RT_PADS]; /* SW_PAD_CTL_PAD */
    uint8_t daisy[RT_DAISIES];
    int8_t outside[RT_PADS]; /* driven by rt1062_drive_pin() */
    int8_t wired[RT_PADS];   /* driven by what the pin is wired to */
    int8_t pulled[RT_PADS];  /* by a resistor outside */
    int8_t level[RT_PADS];   /* what results */
    bool conflict[RT_PADS];
    uint64_t edge_ns; /* when the change that is being told happened; 0: now */
    bool begun;       /* wired, pulled and outside hold levels: RAM of zeros is no state */
} rt_pads_t;

/* Pad of a Teensy pin, RT_NO_PAD if there is none. */
uint32_t rt_pad_of_pin(uint32_t teensy_pin);
/* Level now. A bus line that moves by itself is brought up to date first. */
int rt_pad_level(rt1062_t *m, uint32_t pad);
/* The pad is switched to this alternative function. */
bool rt_pad_is(const rt1062_t *m, uint32_t pad, uint32_t alternative);
/* The input path is forced on (SION). */
bool rt_pad_sion(const rt1062_t *m, uint32_t pad);
/* A pull-up, pull-down or keeper of the pad itself is on. */
bool rt_pad_pulls(const rt1062_t *m, uint32_t pad);
/* Something that decides the pad's level changed. */
void rt_pad_update(rt1062_t *m, uint32_t pad);
/* What the pin is wired to drives it (0, 1) or lets go (RT_FLOATING). @param at_ns when; 0: now. */
void rt_pad_wire(rt1062_t *m, uint32_t pad, int level, uint64_t at_ns);
/* Time of the change that is being told. */
uint64_t rt_pad_edge_ns(const rt1062_t *m);

#endif
