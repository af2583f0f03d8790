/* SPDX-License-Identifier: MIT */
/*
 * Quadrature decoders: counts from filtered levels. A level counts once it has been the same for (FILT_CNT + 3)
 * samples, FILT_PER bus clocks apart, and two clocks more (RM, register FILT). Nothing here happens by itself: levels
 * are settled whenever somebody looks or an edge comes.
 */
#include "clocks.h"
#include "devices.h"
#include "machine.h"
#include "pads.h"
#include "xbar.h"

enum {
    CTRL = 0x00,
    FILT = 0x02,
    POSD = 0x06,
    POSDH = 0x08,
    UPOS = 0x0E,
    LPOS = 0x10,
    UPOSH = 0x12,
    LPOSH = 0x14,
    UINIT = 0x16,
    LINIT = 0x18,
    IMR = 0x1A,
    CTRL2 = 0x1E,
    SPACING = 0x4000,
    CTRL_REV = 1 << 10,
    CTRL_SWIP = 1 << 11,
    CTRL_FLAGS =
        1 << 1 | 1 << 4 | 1 << 8 | 1 << 15, /* CMPIRQ, DIRQ, XIRQ, HIRQ: cleared by writing 1, never set here */
    CTRL2_DIR = 1 << 3,                     /* read-only: counting up */
    CTRL2_FLAGS = 1 << 5 | 1 << 7,          /* RUIRQ, ROIRQ: likewise */
    CTRL2_SABIRQ = 1 << 11,                 /* both phases changed at once */
    FIRST_OUTPUT = 66,                      /* [core] imxrt.h, XBARA1_OUT_ENC1_PHASEA_INPUT */
    OUTPUTS_PER_UNIT = 5
};

static uint32_t output_of(uint32_t unit, uint32_t phase) {
    return FIRST_OUTPUT + OUTPUTS_PER_UNIT * unit + phase;
}

/* ------------------------------------------------------------------ decoding */

/* From the input to a level that counts [ns]. FILT_PER 0: no filter. */
static uint64_t filter_delay_ns(const rt1062_t *m, const rt_enc_t *enc) {
    const uint32_t period = enc->filter & 0xFF;
    const uint32_t samples = (enc->filter >> 8 & 7) + 3;
    const uint64_t clocks = period == 0 ? 0 : ((uint64_t)samples * period << (enc->filter >> 13)) + 2;
    const uint32_t bus_Hz = rt_clock_hz(m, RT_ROOT_IPG);
    return bus_Hz == 0 ? RT_NEVER / 2 : clocks * 1000000000u / bus_Hz;
}

/* A leads B: up. */
static void step(rt_enc_t *enc, uint32_t phase) {
    const bool a = enc->phase[0].filtered;
    const bool b = enc->phase[1].filtered;
    const bool up = (phase == 0 ? a != b : a == b) != ((enc->control & CTRL_REV) != 0);
    enc->position += up ? 1u : UINT32_MAX;
    enc->difference = (int16_t)(enc->difference + (up ? 1 : -1));
    enc->control2 = (uint16_t)(up ? enc->control2 | CTRL2_DIR : enc->control2 & ~CTRL2_DIR);
}

/* Let the filtered levels follow as far as their time has come. */
static void settle(const rt1062_t *m, rt_enc_t *enc, uint64_t now_ns) {
    const uint64_t delay_ns = filter_delay_ns(m, enc);
    bool due[2];
    for (uint32_t i = 0; i < 2; i++) {
        const rt_enc_input_t *input = &enc->phase[i];
        due[i] = input->raw != input->filtered && now_ns >= input->changed_ns + delay_ns;
    }
    if (due[0] && due[1] && enc->phase[0].changed_ns == enc->phase[1].changed_ns) {
        enc->phase[0].filtered = enc->phase[0].raw;
        enc->phase[1].filtered = enc->phase[1].raw;
        enc->control2 |= CTRL2_SABIRQ; /* no telling which way: no count */
        return;
    }
    const uint32_t first = enc->phase[0].changed_ns <= enc->phase[1].changed_ns ? 0 : 1;
    for (uint32_t i = 0; i < 2; i++) {
        const uint32_t phase = i == 0 ? first : 1 - first;
        if (due[phase]) {
            enc->phase[phase].filtered = enc->phase[phase].raw;
            step(enc, phase);
        }
    }
}

static void take_levels(rt1062_t *m, uint32_t unit) {
    rt_enc_t *enc = &m->s.enc[unit];
    const bool level[2] = {rt_xbar_level(m, output_of(unit, 0)), rt_xbar_level(m, output_of(unit, 1))};
    if (level[0] == enc->phase[0].raw && level[1] == enc->phase[1].raw) {
        return;
    }
    const uint64_t at_ns = rt_pad_edge_ns(m);
    settle(m, enc, at_ns);
    for (uint32_t i = 0; i < 2; i++) {
        if (enc->phase[i].raw != level[i]) {
            enc->phase[i].raw = level[i];
            enc->phase[i].changed_ns = at_ns;
        }
    }
    settle(m, enc, at_ns);
}

void rt_enc_inputs_changed(rt1062_t *m) {
    for (uint32_t unit = 0; unit < RT_ENCODERS; unit++) {
        take_levels(m, unit);
    }
}

/* ------------------------------------------------------------------ registers */

static bool clocked(rt1062_t *m, uint32_t unit) {
    static const char *const names[RT_ENCODERS] = {"ENC1", "ENC2", "ENC3", "ENC4"};
    return rt_clock_needed(m, (rt_clock_gate_t)(RT_CLOCK_ENC1 + unit), names[unit]);
}

/* The decoder that an access is for, as it is now. NULL: the access is over; *good says whether there is such a
 * register. */
static rt_enc_t *reached(rt1062_t *m, uint32_t offset, uint32_t size, bool *good) {
    const uint32_t unit = offset / SPACING;
    *good = size == 2;
    if (!*good || !clocked(m, unit)) {
        return NULL;
    }
    settle(m, &m->s.enc[unit], rt_now(m));
    return &m->s.enc[unit];
}

static void expect_pins(rt1062_t *m, uint32_t unit) {
    for (uint32_t phase = 0; phase < 2; phase++) {
        if (rt_xbar_output_pad(m, output_of(unit, phase)) == RT_NO_PAD) {
            rt_finding(m, RT1062_FINDING_PINS,
                       "ENC%u is read, but no pin reaches its phase %c: check mux, SELECT_INPUT and XBAR1",
                       (unsigned)unit + 1, phase == 0 ? 'A' : 'B');
        }
    }
}

/* Reading a counter copies all of them into the hold registers, so that they belong together. */
static void hold(rt_enc_t *enc) {
    enc->position_hold = enc->position;
    enc->difference_hold = enc->difference;
}

static uint32_t read_counter(rt1062_t *m, uint32_t unit, uint32_t offset) {
    rt_enc_t *enc = &m->s.enc[unit];
    expect_pins(m, unit);
    hold(enc);
    if (offset == POSD) {
        enc->difference = 0;
        return (uint16_t)enc->difference_hold;
    }
    return offset == UPOS ? enc->position >> 16 : enc->position & 0xFFFF;
}

static uint32_t inputs(const rt_enc_t *enc) {
    return (uint32_t)enc->phase[1].raw << 2 | (uint32_t)enc->phase[0].raw << 3 | (uint32_t)enc->phase[1].filtered << 6 |
           (uint32_t)enc->phase[0].filtered << 7;
}

static bool read(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    bool good;
    rt_enc_t *enc = reached(m, offset, size, &good);
    *value = 0;
    if (enc == NULL) {
        return good;
    }
    switch (offset % SPACING) {
    case CTRL:
        *value = enc->control;
        return true;
    case FILT:
        *value = enc->filter;
        return true;
    case POSD:
    case UPOS:
    case LPOS:
        *value = read_counter(m, offset / SPACING, offset % SPACING);
        return true;
    case POSDH:
        *value = (uint16_t)enc->difference_hold;
        return true;
    case UPOSH:
        *value = enc->position_hold >> 16;
        return true;
    case LPOSH:
        *value = enc->position_hold & 0xFFFF;
        return true;
    case UINIT:
        *value = enc->init >> 16;
        return true;
    case LINIT:
        *value = enc->init & 0xFFFF;
        return true;
    case IMR:
        *value = inputs(enc);
        return true;
    case CTRL2:
        *value = enc->control2;
        return true;
    default:
        return false;
    }
}

static uint32_t with_upper(uint32_t whole, uint32_t half) {
    return (whole & 0xFFFF) | half << 16;
}

static uint32_t with_lower(uint32_t whole, uint32_t half) {
    return (whole & 0xFFFF0000u) | half;
}

/* Watchdog, index, home, compare, interrupts, modulus and trigger are not modelled: asking for one is refused. */
static bool write_control(rt_enc_t *enc, uint32_t value) {
    if ((value & ~(uint32_t)(CTRL_REV | CTRL_SWIP | CTRL_FLAGS)) != 0) {
        return false;
    }
    if ((value & CTRL_SWIP) != 0) {
        enc->position = enc->init;
    }
    enc->control = value & CTRL_REV;
    return true;
}

static bool write_control2(rt_enc_t *enc, uint32_t value) {
    if ((value & ~(uint32_t)(CTRL2_DIR | CTRL2_FLAGS | CTRL2_SABIRQ)) != 0) {
        return false;
    }
    enc->control2 &= (uint16_t) ~(value & CTRL2_SABIRQ);
    return true;
}

static bool write(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    bool good;
    rt_enc_t *enc = reached(m, offset, size, &good);
    if (enc == NULL) {
        return good;
    }
    switch (offset % SPACING) {
    case CTRL:
        return write_control(enc, value);
    case FILT:
        enc->filter = (uint16_t)(value & 0xE7FF);
        return true;
    case UPOS:
        enc->position = with_upper(enc->position, value);
        return true;
    case LPOS:
        enc->position = with_lower(enc->position, value);
        return true;
    case UINIT:
        enc->init = with_upper(enc->init, value);
        return true;
    case LINIT:
        enc->init = with_lower(enc->init, value);
        return true;
    case CTRL2:
        return write_control2(enc, value);
    default:
        return false;
    }
}

static void reset(rt1062_t *m) {
    for (uint32_t unit = 0; unit < RT_ENCODERS; unit++) {
        m->s.enc[unit] = (rt_enc_t){0};
    }
}

const rt_device_t rt_enc = {"ENC1..4", 0x403C8000, RT_ENCODERS *SPACING, read, write, reset};
