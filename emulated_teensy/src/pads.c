/* SPDX-License-Identifier: MIT */
#include "pads.h"

#include "devices.h"
#include "gpio.h"
#include "lpi2c.h"
#include "machine.h"
#include "pins.h"
#include "xbar.h"

enum {
    MUX_BASE = 0x014,
    CONTROL_BASE = 0x204,
    MUX_MODE = 0xF,
    MUX_SION = 0x10,
    CONTROL_MASK = 0x1F8F9, /* HYS, PUS, PUE, PKE, ODE, SPEED, DSE, SRE */
    CONTROL_RESET = 0x10B0, /* keeper, 100 MHz, R0/6 */
    CONTROL_PUS = 3 << 14,
    CONTROL_PUE = 1 << 13,
    CONTROL_PKE = 1 << 12,
    CONTROL_ODE = 1 << 11,
    ALT_UART_TX = 2,
    ALT_JTAG = 0
};

/* Offsets and widths of the SELECT_INPUT registers. */
static const struct {
    uint16_t offset;
    uint8_t mask;
} daisies[RT_DAISIES] = {
    [RT_DAISY_LPI2C1_SCL] = {0x4CC, 1}, [RT_DAISY_LPI2C1_SDA] = {0x4D0, 1}, [RT_DAISY_LPI2C3_SCL] = {0x4DC, 3},
    [RT_DAISY_LPI2C3_SDA] = {0x4E0, 3}, [RT_DAISY_LPI2C4_SCL] = {0x4E4, 1}, [RT_DAISY_LPI2C4_SDA] = {0x4E8, 1},
    [RT_DAISY_LPUART6_RX] = {0x550, 1}, [RT_DAISY_LPUART6_TX] = {0x554, 1}, [RT_DAISY_XBAR02] = {0x60C, 1},
    [RT_DAISY_XBAR03] = {0x610, 1},     [RT_DAISY_XBAR04] = {0x614, 1},     [RT_DAISY_XBAR05] = {0x618, 1},
    [RT_DAISY_XBAR06] = {0x61C, 1},     [RT_DAISY_XBAR07] = {0x620, 1},     [RT_DAISY_XBAR08] = {0x624, 1},
    [RT_DAISY_XBAR09] = {0x628, 1},     [RT_DAISY_XBAR17] = {0x62C, 3},     [RT_DAISY_XBAR18] = {0x630, 1},
    [RT_DAISY_XBAR20] = {0x634, 1},     [RT_DAISY_XBAR22] = {0x638, 1},     [RT_DAISY_XBAR23] = {0x63C, 1},
    [RT_DAISY_XBAR24] = {0x640, 1},     [RT_DAISY_XBAR14] = {0x644, 1},     [RT_DAISY_XBAR15] = {0x648, 1},
    [RT_DAISY_XBAR16] = {0x64C, 1},     [RT_DAISY_XBAR25] = {0x650, 1},     [RT_DAISY_XBAR19] = {0x654, 1},
    [RT_DAISY_XBAR21] = {0x658, 1},
};

/* [core] core_pins.h, CORE_PINn_CONFIG. */
static const uint8_t teensy_pins[RT_TEENSY_PINS] = {
    RT_PAD_AD_B0 + 3,  RT_PAD_AD_B0 + 2,  RT_PAD_EMC + 4,    RT_PAD_EMC + 5,    RT_PAD_EMC + 6,   RT_PAD_EMC + 8,
    RT_PAD_B0 + 10,    RT_PAD_B1 + 1,     RT_PAD_B1 + 0,     RT_PAD_B0 + 11,    RT_PAD_B0 + 0,    RT_PAD_B0 + 2,
    RT_PAD_B0 + 1,     RT_PAD_B0 + 3,     RT_PAD_AD_B1 + 2,  RT_PAD_AD_B1 + 3,  RT_PAD_AD_B1 + 7, RT_PAD_AD_B1 + 6,
    RT_PAD_SDA,        RT_PAD_SCL,        RT_PAD_AD_B1 + 10, RT_PAD_AD_B1 + 11, RT_PAD_AD_B1 + 8, RT_PAD_AD_B1 + 9,
    RT_PAD_AD_B0 + 12, RT_PAD_AD_B0 + 13, RT_PAD_AD_B1 + 14, RT_PAD_AD_B1 + 15, RT_PAD_EMC + 32,  RT_PAD_EMC + 31,
    RT_PAD_EMC + 37,   RT_PAD_EMC + 36,   RT_PAD_B0 + 12,    RT_PAD_EMC + 7,    RT_PAD_SD_B0 + 3, RT_PAD_SD_B0 + 2,
    RT_PAD_SD_B0 + 1,  RT_PAD_SD_B0 + 0,  RT_PAD_SD_B0 + 5,  RT_PAD_SD_B0 + 4,
};

uint32_t rt_pad_of_pin(uint32_t teensy_pin) {
    return teensy_pin < RT_TEENSY_PINS ? teensy_pins[teensy_pin] : (uint32_t)RT_NO_PAD;
}

static uint32_t pin_of_pad(uint32_t pad) {
    uint32_t pin = 0;
    while (pin < RT_TEENSY_PINS && teensy_pins[pin] != pad) {
        pin++;
    }
    return pin;
}

bool rt_pad_is(const rt1062_t *m, uint32_t pad, uint32_t alternative) {
    return (m->s.pads.mux[pad] & MUX_MODE) == alternative;
}

bool rt_pad_sion(const rt1062_t *m, uint32_t pad) {
    return (m->s.pads.mux[pad] & MUX_SION) != 0;
}

bool rt_pad_pulls(const rt1062_t *m, uint32_t pad) {
    return (m->s.pads.control[pad] & CONTROL_PKE) != 0;
}

/* ------------------------------------------------------------------ levels */

/* What the chip itself does to the pad. */
static int driven_by_chip(const rt1062_t *m, uint32_t pad) {
    int level = RT_FLOATING;
    if (rt_pad_is(m, pad, RT_ALT_GPIO)) {
        level = rt_gpio_drives(m, pad);
    } else if (pad == RT_PAD_UART_TX && rt_pad_is(m, pad, ALT_UART_TX)) {
        level = 1; /* idle: its bytes do not go over this pad's level */
    } else {
        level = rt_i2c_drives(m, pad);
    }
    const bool open_drain = (m->s.pads.control[pad] & CONTROL_ODE) != 0;
    return level == 1 && open_drain ? RT_FLOATING : level;
}

static int pulled_level(const rt1062_t *m, uint32_t pad) {
    const uint32_t control = m->s.pads.control[pad];
    if (m->s.pads.pulled[pad] != RT_FLOATING) {
        return m->s.pads.pulled[pad];
    }
    if ((control & CONTROL_PKE) == 0) {
        return RT_FLOATING;
    }
    if ((control & CONTROL_PUE) == 0) {
        return m->s.pads.level[pad]; /* the keeper */
    }
    return (control & CONTROL_PUS) != 0; /* 00: 100 kohm down, else 47, 100, 22 kohm up */
}

static int resolve(rt1062_t *m, uint32_t pad) {
    const int drivers[] = {driven_by_chip(m, pad), m->s.pads.wired[pad], m->s.pads.outside[pad]};
    bool low = false;
    bool high = false;
    for (uint32_t i = 0; i < 3; i++) {
        low = low || drivers[i] == 0;
        high = high || drivers[i] == 1;
    }
    const bool conflict = low && high;
    if (conflict && !m->s.pads.conflict[pad]) {
        rt_finding(m, RT1062_FINDING_PINS, "pin %u is driven low and high at once (chip %d, wire %d, outside %d)",
                   (unsigned)pin_of_pad(pad), drivers[0], drivers[1], drivers[2]);
    }
    m->s.pads.conflict[pad] = conflict;
    return low ? 0 : high ? 1 : pulled_level(m, pad);
}

void rt_pad_update(rt1062_t *m, uint32_t pad) {
    const int level = resolve(m, pad);
    const bool changed = level != m->s.pads.level[pad];
    m->s.pads.level[pad] = (int8_t)level;
    rt_gpio_input_changed(m, pad);
    if (changed) {
        rt_enc_inputs_changed(m);
        rt_i2c_line_changed(m, pad);
        rt_pins_level_changed(m, pad);
    }
}

void rt_pad_wire(rt1062_t *m, uint32_t pad, int level, uint64_t at_ns) {
    if (m->s.pads.wired[pad] != level) {
        m->s.pads.wired[pad] = (int8_t)level;
        m->s.pads.edge_ns = at_ns;
        rt_pad_update(m, pad);
        m->s.pads.edge_ns = 0;
    }
}

uint64_t rt_pad_edge_ns(const rt1062_t *m) {
    return m->s.pads.edge_ns != 0 ? m->s.pads.edge_ns : rt_now(m);
}

int rt_pad_level(rt1062_t *m, uint32_t pad) {
    if (pad == RT_PAD_SCL || pad == RT_PAD_SDA || pad == RT_PAD_SCL3 || pad == RT_PAD_SDA3) {
        rt_i2c_sync(m);
    }
    return m->s.pads.level[pad];
}

int32_t rt1062_pin(rt1062_t *m, uint32_t teensy_pin) {
    const uint32_t pad = rt_pad_of_pin(teensy_pin);
    return pad == RT_NO_PAD || !m->s.powered ? RT_FLOATING : rt_pad_level(m, pad);
}

void rt1062_drive_pin(rt1062_t *m, uint32_t teensy_pin, int32_t level) {
    const uint32_t pad = rt_pad_of_pin(teensy_pin);
    if (pad != RT_NO_PAD) {
        rt_i2c_sync(m);
        m->s.pads.outside[pad] = (int8_t)level;
        rt_pad_update(m, pad);
        rt_i2c_sync(m);
    }
}

/* ------------------------------------------------------------------ registers */

/* A register of the page. */
typedef struct place_t {
    enum { NO_REGISTER, MUX, CONTROL, DAISY } kind;
    uint32_t number; /* of the pad, of the daisy */
    uint32_t writable;
} place_t;

static place_t place_of(uint32_t offset) {
    if (offset - MUX_BASE < 4 * RT_PADS) {
        return (place_t){MUX, (offset - MUX_BASE) / 4, MUX_MODE | MUX_SION};
    }
    if (offset - CONTROL_BASE < 4 * RT_PADS) {
        return (place_t){CONTROL, (offset - CONTROL_BASE) / 4, CONTROL_MASK};
    }
    for (uint32_t daisy = 0; daisy < RT_DAISIES; daisy++) {
        if (daisies[daisy].offset == offset) {
            return (place_t){DAISY, daisy, daisies[daisy].mask};
        }
    }
    return (place_t){NO_REGISTER, 0, 0};
}

static bool read(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    const place_t place = place_of(offset);
    const rt_pads_t *pads = &m->s.pads;
    if (size != 4 || place.kind == NO_REGISTER) {
        return false;
    }
    *value = place.kind == MUX       ? pads->mux[place.number]
             : place.kind == CONTROL ? pads->control[place.number]
                                     : pads->daisy[place.number];
    return true;
}

static void store(rt1062_t *m, place_t place, uint32_t value) {
    rt_pads_t *pads = &m->s.pads;
    if (place.kind == DAISY) {
        pads->daisy[place.number] = (uint8_t)value;
        return;
    }
    *(place.kind == MUX ? &pads->mux[place.number] : &pads->control[place.number]) = value;
    rt_pad_update(m, place.number);
}

static bool write(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    const place_t place = place_of(offset);
    if (size != 4 || place.kind == NO_REGISTER) {
        return false;
    }
    if ((value & ~place.writable) != 0) {
        rt_refuse(m, "IOMUXC register 0x%08X has no bits 0x%08X", 0x401F8000u + (unsigned)offset,
                  (unsigned)(value & ~place.writable));
        return true;
    }
    rt_i2c_sync(m);
    store(m, place, value);
    rt_enc_inputs_changed(m);
    rt_i2c_sync(m);
    return true;
}

static void reset(rt1062_t *m) {
    rt_pads_t *pads = &m->s.pads;
    for (uint32_t pad = 0; pad < RT_PADS; pad++) {
        const bool jtag_or_boot = pad >= RT_PAD_AD_B0 + 4 && pad <= RT_PAD_AD_B0 + 11;
        pads->mux[pad] = jtag_or_boot ? ALT_JTAG : RT_ALT_GPIO;
        pads->control[pad] = CONTROL_RESET;
        if (!pads->begun) {
            pads->outside[pad] = pads->wired[pad] = pads->pulled[pad] = pads->level[pad] = RT_FLOATING;
        }
    }
    for (uint32_t daisy = 0; daisy < RT_DAISIES; daisy++) {
        pads->daisy[daisy] = 0;
    }
    pads->begun = true;
}

const rt_device_t rt_iomuxc = {"IOMUXC", 0x401F8000, 0x1000, read, write, reset};
