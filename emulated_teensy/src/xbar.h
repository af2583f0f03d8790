/* SPDX-License-Identifier: MIT */
/**
 * @file xbar.h
 * Crossbar XBAR1 and quadrature decoders ENC1..4 (i.MX RT1060 RM, chapters Inter-Peripheral Crossbar Switch A and
 * Quadrature Encoder/Decoder).
 *
 * A decoder sees a pin through the pad's alternative, the input's SELECT_INPUT, the direction bit in IOMUXC_GPR6 and
 * the crossbar. If one of these is wrong it sees a constant low, and the first read of its count is a finding.
 */
#ifndef EMULATED_TEENSY_XBAR_H
#define EMULATED_TEENSY_XBAR_H

#include <stdbool.h>
#include <stdint.h>

#include "emulated_teensy/rt1062.h"

enum { RT_XBAR_OUTPUTS = 132, RT_ENCODERS = 4 };

typedef struct rt_xbar_t {
    uint8_t source[RT_XBAR_OUTPUTS]; /* number of the input that an output shows */
} rt_xbar_t;

/* One input of a decoder behind its filter. */
typedef struct rt_enc_input_t {
    bool raw;
    bool filtered;
    uint64_t changed_ns; /* when `raw` last changed */
} rt_enc_input_t;

typedef struct rt_enc_t {
    rt_enc_input_t phase[2]; /* A, B */
    uint32_t position;
    uint32_t position_hold;
    int16_t difference; /* POSD */
    int16_t difference_hold;
    uint32_t init;
    uint16_t control;
    uint16_t control2;
    uint16_t filter;
} rt_enc_t;

/* The pad that a crossbar input listens to now, RT_NO_PAD: none. */
uint32_t rt_xbar_pad(const rt1062_t *m, uint32_t input);
/* The pad behind a crossbar output, RT_NO_PAD: none. */
uint32_t rt_xbar_output_pad(const rt1062_t *m, uint32_t output);
/* Level of a crossbar output. */
bool rt_xbar_level(const rt1062_t *m, uint32_t output);
/* A pad's level or a way to a decoder may have changed. */
void rt_enc_inputs_changed(rt1062_t *m);

#endif
