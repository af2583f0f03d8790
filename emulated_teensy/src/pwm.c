/* SPDX-License-Identifier: MIT */
/* i.MX RT1060 RM, chapters eFlexPWM and Quad Timer; offsets as in imxrt.h of the core. */
#include "pwm.h"

#include <string.h>

#include "clocks.h"
#include "devices.h"
#include "machine.h"
#include "pads.h"

/* FlexPWM: four submodules of 0x60 bytes, then what they share. */
enum {
    SUBMODULES_END = 0x180,
    SUBMODULE = 0x60,
    INIT = 0x02,
    CTRL = 0x06,
    VAL1 = 0x0E,
    VAL2 = 0x12,
    OUTPUT_VALUES = 8, /* bytes from A's two values to B's */
    OUTEN = 0x180,
    MCTRL = 0x188,
    FCTRL0 = 0x18C,
    FSTS0 = 0x18E,
    FFILT0 = 0x190,
    FLEXPWM_STEP = 0x4000,
    OUTEN_A = 8, /* first bit of the four submodules' */
    OUTEN_B = 4
};

#define MCTRL_LDOK 0x000Fu  /* goes when the values are taken over: at once here */
#define MCTRL_CLDOK 0x00F0u /* reads as zero */
#define MCTRL_RUN 8         /* first bit of the four submodules' */

/* Quad timers: channels of 0x20 bytes. */
enum { QUAD_LOAD = 0x06, QUAD_CTRL = 0x0C, CMPLD1 = 0x10, QUAD_STEP = 0x4000, CHANNEL = 0x20, CHANNELS_END = 0x80 };

/* INIT, CTRL2, CTRL, VAL0..5, OCTRL, DTCNT0 */
static const uint8_t submodule_registers[] = {0x02, 0x04, 0x06, 0x0A, 0x0E, 0x12, 0x16, 0x1A, 0x1E, 0x22, 0x30};
/* COMP1, LOAD, CNTR, CTRL, SCTRL, CMPLD1, CSCTRL of each of four channels of 0x20 bytes */
static const uint8_t channel_registers[] = {0x00, 0x06, 0x0A, 0x0C, 0x0E, 0x10, 0x14};

static bool among(const uint8_t *offsets, uint32_t count, uint32_t offset) {
    for (uint32_t i = 0; i < count; i++) {
        if (offsets[i] == offset) {
            return true;
        }
    }
    return false;
}

static void look_at_gate(rt1062_t *m, rt_clock_gate_t gate, const char *what) {
    if (!rt_clock_on(m, gate)) {
        rt_finding(m, RT1062_FINDING_CLOCK, "%s is accessed while its clock gate in CCM_CCGR is off", what);
    }
}

/* ------------------------------------------------------------------ FlexPWM */

/* A register of a submodule; NULL: there is none. */
static uint16_t *submodule_register(rt_flexpwm_t *pwm, uint32_t at) {
    const bool known = at < SUBMODULES_END && among(submodule_registers, sizeof submodule_registers, at % SUBMODULE);
    return known ? &pwm->written[at / SUBMODULE][at % SUBMODULE / 2] : NULL;
}

static bool flexpwm_read(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    const uint32_t number = offset / FLEXPWM_STEP;
    const uint32_t at = offset % FLEXPWM_STEP;
    rt_flexpwm_t *pwm = &m->s.flexpwm[number];
    const uint16_t *kept = at == MCTRL ? &pwm->control : at == OUTEN ? &pwm->enabled : submodule_register(pwm, at);
    look_at_gate(m, (rt_clock_gate_t)(RT_CLOCK_PWM1 + number), "FlexPWM");
    *value = kept != NULL ? *kept : 0;
    return size == 2 && kept != NULL;
}

static void control(rt_flexpwm_t *pwm, uint32_t value) {
    for (uint32_t i = 0; i < RT_SUBMODULES; i++) {
        if ((value & MCTRL_LDOK) >> i & 1) {
            memcpy(pwm->loaded[i], pwm->written[i], sizeof pwm->loaded[i]);
        }
    }
    pwm->control = (uint16_t)(value & ~(MCTRL_LDOK | MCTRL_CLDOK));
}

static bool flexpwm_write(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    const uint32_t number = offset / FLEXPWM_STEP;
    const uint32_t at = offset % FLEXPWM_STEP;
    rt_flexpwm_t *pwm = &m->s.flexpwm[number];
    uint16_t *kept = submodule_register(pwm, at);
    look_at_gate(m, (rt_clock_gate_t)(RT_CLOCK_PWM1 + number), "FlexPWM");
    if (size != 2) {
        return false;
    }
    if (kept != NULL) {
        *kept = (uint16_t)value;
    } else if (at == MCTRL) {
        control(pwm, value);
    } else if (at == OUTEN) {
        pwm->enabled = (uint16_t)value;
    }
    return kept != NULL || at == MCTRL || at == OUTEN || at == FCTRL0 || at == FSTS0 || at == FFILT0;
}

static void flexpwm_reset(rt1062_t *m) {
    memset(m->s.flexpwm, 0, sizeof m->s.flexpwm);
}

/* ------------------------------------------------------------------ quad timers */

static uint16_t *channel_register(rt1062_t *m, uint32_t offset) {
    const uint32_t at = offset % QUAD_STEP;
    const bool known = at < CHANNELS_END && among(channel_registers, sizeof channel_registers, at % CHANNEL);
    return known ? &m->s.quad_timer[offset / QUAD_STEP].words[at / 2] : NULL;
}

static bool quad_timer_read(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    const uint16_t *kept = channel_register(m, offset);
    look_at_gate(m, (rt_clock_gate_t)(RT_CLOCK_QTIMER1 + offset / QUAD_STEP), "a quad timer");
    *value = kept != NULL ? *kept : 0;
    return size == 2 && kept != NULL;
}

static bool quad_timer_write(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    uint16_t *kept = channel_register(m, offset);
    look_at_gate(m, (rt_clock_gate_t)(RT_CLOCK_QTIMER1 + offset / QUAD_STEP), "a quad timer");
    if (size != 2 || kept == NULL) {
        return false;
    }
    *kept = (uint16_t)value;
    return true;
}

static void quad_timers_reset(rt1062_t *m) {
    memset(m->s.quad_timer, 0, sizeof m->s.quad_timer);
}

/* ------------------------------------------------------------------ pads */

/* Outputs of timers at the pads that are Teensy pins (RM, chapter External Signals and Pin Multiplexing). */
static const struct {
    uint8_t pad;
    uint8_t alternative;
    bool quad;
    uint8_t timer;  /* from 0 */
    uint8_t part;   /* submodule or channel */
    uint8_t output; /* FlexPWM: 0: A, 1: B */
} outputs[] = {
    {RT_PAD_EMC + 4, 1, false, 3, 2, 0},   {RT_PAD_EMC + 5, 1, false, 3, 2, 1}, {RT_PAD_EMC + 6, 1, false, 1, 0, 0},
    {RT_PAD_EMC + 7, 1, false, 1, 0, 1},   {RT_PAD_EMC + 8, 1, false, 1, 1, 0}, {RT_PAD_EMC + 31, 1, false, 2, 1, 0},
    {RT_PAD_EMC + 32, 1, false, 2, 1, 1},  {RT_PAD_B0 + 10, 2, false, 1, 2, 0}, {RT_PAD_B0 + 11, 2, false, 1, 2, 1},
    {RT_PAD_B1 + 0, 6, false, 0, 3, 0},    {RT_PAD_B1 + 1, 6, false, 0, 3, 1},  {RT_PAD_AD_B1 + 8, 1, false, 3, 0, 0},
    {RT_PAD_AD_B1 + 9, 1, false, 3, 1, 0}, {RT_PAD_B0 + 0, 1, true, 0, 0, 0},   {RT_PAD_B0 + 1, 1, true, 0, 1, 0},
    {RT_PAD_B0 + 2, 1, true, 0, 2, 0},     {RT_PAD_B0 + 3, 1, true, 1, 0, 0},   {RT_PAD_AD_B1 + 2, 1, true, 2, 2, 0},
    {RT_PAD_AD_B1 + 3, 1, true, 2, 3, 0},
};

static bool flexpwm_pulses(const rt1062_t *m, uint32_t number, uint32_t part, uint32_t output, rt_pulses_t *pulses) {
    const rt_flexpwm_t *pwm = &m->s.flexpwm[number];
    const uint16_t *loaded = pwm->loaded[part];
    const uint32_t at = VAL2 + OUTPUT_VALUES * output;
    const uint32_t length = (uint16_t)(loaded[VAL1 / 2] - loaded[INIT / 2]) + 1u;
    const uint32_t high = (uint16_t)(loaded[(at + OUTPUT_VALUES / 2) / 2] - loaded[at / 2]);
    const bool enabled = (pwm->enabled >> (output == 0 ? OUTEN_A : OUTEN_B) >> part & 1) != 0;
    if (!enabled || (pwm->control >> MCTRL_RUN >> part & 1) == 0) {
        return false;
    }
    const uint32_t prescale = loaded[CTRL / 2] >> 4 & 7;
    pulses->share = high >= length ? 1.0 : (double)high / length;
    pulses->frequency_Hz = (double)(rt_clock_hz(m, RT_ROOT_IPG) >> prescale) / length;
    return true;
}

static bool quad_pulses(const rt1062_t *m, uint32_t number, uint32_t part, rt_pulses_t *pulses) {
    const uint16_t *words = m->s.quad_timer[number].words + part * CHANNEL / 2;
    const uint32_t running = words[QUAD_CTRL / 2] >> 13;
    const uint32_t prescale = words[QUAD_CTRL / 2] >> 9 & 7; /* PCS 8..15: bus clock / 1..128 */
    const double high = (double)words[CMPLD1 >> 1];
    const double length = high + 65537.0 - (double)words[QUAD_LOAD >> 1];
    pulses->share = high / length;
    pulses->frequency_Hz = (double)(rt_clock_hz(m, RT_ROOT_IPG) >> prescale) / length;
    return running != 0;
}

bool rt_pwm_pulses(const rt1062_t *m, uint32_t pad, rt_pulses_t *pulses) {
    for (uint32_t i = 0; i < sizeof outputs / sizeof outputs[0]; i++) {
        if (outputs[i].pad == pad && rt_pad_is(m, pad, outputs[i].alternative)) {
            return outputs[i].quad ? quad_pulses(m, outputs[i].timer, outputs[i].part, pulses)
                                   : flexpwm_pulses(m, outputs[i].timer, outputs[i].part, outputs[i].output, pulses);
        }
    }
    return false;
}

const rt_device_t rt_flexpwm = {"FlexPWM",    0x403DC000,    RT_FLEXPWMS *FLEXPWM_STEP,
                                flexpwm_read, flexpwm_write, flexpwm_reset};
const rt_device_t rt_quad_timers = {"quad timer",    0x401DC000,       0xC000,
                                    quad_timer_read, quad_timer_write, quad_timers_reset};
