/* SPDX-License-Identifier: MIT */
#include "xbar.h"

#include "clocks.h"
#include "devices.h"
#include "machine.h"
#include "pads.h"

enum {
    SELECT_MASK = 0x7F,
    LOGIC_HIGH = 1, /* inputs 0 and 1 are constants */
    GPR6 = 6,
    FIRST_TWO_WAY = 4, /* XBAR_INOUT04..19 have a direction: GPR6 bits 16..31 */
    LAST_TWO_WAY = 19,
    NO_DAISY = RT_DAISIES
};

/*
 * Pads that reach an input: NXP's fsl_iomuxc.h for MIMXRT1062, IOMUXC_..._XBAR1_IN..: pad, alternative, input,
 * SELECT_INPUT and its value.
 */
static const struct {
    uint8_t pad;
    uint8_t alternative;
    uint8_t input;
    uint8_t daisy;
    uint8_t value;
} ways[] = {
    {RT_PAD_EMC + 0, 3, 2, RT_DAISY_XBAR02, 0},     {RT_PAD_B1 + 14, 3, 2, RT_DAISY_XBAR02, 1},
    {RT_PAD_EMC + 1, 3, 3, RT_DAISY_XBAR03, 0},     {RT_PAD_B1 + 15, 3, 3, RT_DAISY_XBAR03, 1},
    {RT_PAD_EMC + 2, 3, 4, RT_DAISY_XBAR04, 0},     {RT_PAD_SD_B0 + 0, 3, 4, RT_DAISY_XBAR04, 1},
    {RT_PAD_EMC + 3, 3, 5, RT_DAISY_XBAR05, 0},     {RT_PAD_SD_B0 + 1, 3, 5, RT_DAISY_XBAR05, 1},
    {RT_PAD_EMC + 4, 3, 6, RT_DAISY_XBAR06, 0},     {RT_PAD_SD_B0 + 2, 3, 6, RT_DAISY_XBAR06, 1},
    {RT_PAD_EMC + 5, 3, 7, RT_DAISY_XBAR07, 0},     {RT_PAD_SD_B0 + 3, 3, 7, RT_DAISY_XBAR07, 1},
    {RT_PAD_EMC + 6, 3, 8, RT_DAISY_XBAR08, 0},     {RT_PAD_SD_B0 + 4, 3, 8, RT_DAISY_XBAR08, 1},
    {RT_PAD_EMC + 7, 3, 9, RT_DAISY_XBAR09, 0},     {RT_PAD_SD_B0 + 5, 3, 9, RT_DAISY_XBAR09, 1},
    {RT_PAD_B0 + 12, 1, 10, NO_DAISY, 0},           {RT_PAD_B0 + 13, 1, 11, NO_DAISY, 0},
    {RT_PAD_B0 + 14, 1, 12, NO_DAISY, 0},           {RT_PAD_B0 + 15, 1, 13, NO_DAISY, 0},
    {RT_PAD_AD_B0 + 0, 1, 14, RT_DAISY_XBAR14, 0},  {RT_PAD_B1 + 0, 1, 14, RT_DAISY_XBAR14, 1},
    {RT_PAD_AD_B0 + 1, 1, 15, RT_DAISY_XBAR15, 0},  {RT_PAD_B1 + 1, 1, 15, RT_DAISY_XBAR15, 1},
    {RT_PAD_AD_B0 + 2, 1, 16, RT_DAISY_XBAR16, 0},  {RT_PAD_B1 + 2, 1, 16, RT_DAISY_XBAR16, 1},
    {RT_PAD_EMC + 8, 3, 17, RT_DAISY_XBAR17, 0},    {RT_PAD_AD_B0 + 3, 1, 17, RT_DAISY_XBAR17, 1},
    {RT_PAD_AD_B0 + 5, 6, 17, RT_DAISY_XBAR17, 2},  {RT_PAD_B1 + 3, 1, 17, RT_DAISY_XBAR17, 3},
    {RT_PAD_EMC + 35, 1, 18, RT_DAISY_XBAR18, 0},   {RT_PAD_AD_B0 + 6, 6, 18, RT_DAISY_XBAR18, 1},
    {RT_PAD_EMC + 14, 1, 19, RT_DAISY_XBAR19, 0},   {RT_PAD_AD_B0 + 7, 6, 19, RT_DAISY_XBAR19, 1},
    {RT_PAD_EMC + 15, 1, 20, RT_DAISY_XBAR20, 0},   {RT_PAD_AD_B0 + 8, 6, 20, RT_DAISY_XBAR20, 1},
    {RT_PAD_EMC + 16, 1, 21, RT_DAISY_XBAR21, 0},   {RT_PAD_AD_B0 + 9, 6, 21, RT_DAISY_XBAR21, 1},
    {RT_PAD_EMC + 36, 1, 22, RT_DAISY_XBAR22, 0},   {RT_PAD_AD_B0 + 10, 6, 22, RT_DAISY_XBAR22, 1},
    {RT_PAD_EMC + 37, 1, 23, RT_DAISY_XBAR23, 0},   {RT_PAD_AD_B0 + 11, 6, 23, RT_DAISY_XBAR23, 1},
    {RT_PAD_EMC + 12, 1, 24, RT_DAISY_XBAR24, 0},   {RT_PAD_AD_B0 + 14, 1, 24, RT_DAISY_XBAR24, 1},
    {RT_PAD_AD_B0 + 15, 1, 25, RT_DAISY_XBAR25, 0}, {RT_PAD_EMC + 13, 1, 25, RT_DAISY_XBAR25, 1},
};

static bool is_input(const rt1062_t *m, uint32_t input) {
    const bool two_way = input >= FIRST_TWO_WAY && input <= LAST_TWO_WAY;
    return !two_way || (m->s.gpr.value[GPR6] >> (16 + input - FIRST_TWO_WAY) & 1) == 0;
}

uint32_t rt_xbar_pad(const rt1062_t *m, uint32_t input) {
    for (uint32_t i = 0; i < sizeof ways / sizeof ways[0]; i++) {
        const bool selected = ways[i].daisy == NO_DAISY || m->s.pads.daisy[ways[i].daisy] == ways[i].value;
        if (ways[i].input == input && selected && rt_pad_is(m, ways[i].pad, ways[i].alternative)) {
            return is_input(m, input) ? ways[i].pad : (uint32_t)RT_NO_PAD;
        }
    }
    return RT_NO_PAD;
}

uint32_t rt_xbar_output_pad(const rt1062_t *m, uint32_t output) {
    return rt_xbar_pad(m, m->s.xbar.source[output]);
}

bool rt_xbar_level(const rt1062_t *m, uint32_t output) {
    const uint32_t pad = rt_xbar_output_pad(m, output);
    return pad == RT_NO_PAD ? m->s.xbar.source[output] == LOGIC_HIGH : m->s.pads.level[pad] == 1;
}

/* ------------------------------------------------------------------ registers */

static bool clocked(rt1062_t *m) {
    return rt_clock_needed(m, RT_CLOCK_XBAR1, "XBAR1");
}

/* SEL0..65: halfwords with two outputs each; bytes are not to be had ([core] pwm.c). */
static bool is_select(uint32_t offset, uint32_t size) {
    return size == 2 && offset < RT_XBAR_OUTPUTS;
}

static bool read(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    if (!is_select(offset, size)) {
        return false;
    }
    *value = clocked(m) ? (uint32_t)m->s.xbar.source[offset] | (uint32_t)m->s.xbar.source[offset + 1] << 8 : 0;
    return true;
}

static bool write(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    if (!is_select(offset, size)) {
        return false;
    }
    if (clocked(m)) {
        m->s.xbar.source[offset] = value & SELECT_MASK;
        m->s.xbar.source[offset + 1] = value >> 8 & SELECT_MASK;
        rt_enc_inputs_changed(m);
    }
    return true;
}

static void reset(rt1062_t *m) {
    m->s.xbar = (rt_xbar_t){0};
}

const rt_device_t rt_xbar1 = {"XBAR1", 0x403BC000, 0x4000, read, write, reset};
