/* SPDX-License-Identifier: MIT */
#include "gpio.h"

#include "clocks.h"
#include "devices.h"
#include "lpi2c.h"
#include "machine.h"
#include "pads.h"

enum {
    DR = 0x00,
    GDIR = 0x04,
    PSR = 0x08,
    ICR1 = 0x0C,
    ICR2 = 0x10,
    IMR = 0x14,
    ISR = 0x18,
    EDGE_SEL = 0x1C,
    DR_SET = 0x84,
    DR_CLEAR = 0x88,
    DR_TOGGLE = 0x8C,
    SPACING = 0x4000,
    GPR26 = 26,
    /* ICR: two bits per pin */
    ON_LOW = 0,
    ON_HIGH = 1,
    ON_RISE = 2,
    ON_FALL = 3,
    /* [core] imxrt.h, IRQ_NUMBER_t */
    IRQ_GPIO1_INT0 = 72,
    IRQ_GPIO1_0_15 = 80,
    IRQ_GPIO6789 = 157,
    OWN_LINES = 8 /* bits 0..7 of GPIO1 have interrupts of their own, too */
};

/* ------------------------------------------------------------------ pads */

/* Bits of the pads in their ports (RM, chapter GPIO, external signals). */
static uint32_t place_of(uint32_t pad, uint32_t *bit) {
    static const struct {
        uint8_t first;
        uint8_t end;
        uint8_t port;
        uint8_t bit;
    } ranges[] = {
        {RT_PAD_EMC, 32, 3, 0},
        {RT_PAD_EMC + 32, RT_PAD_AD_B0, 2, 18},
        {RT_PAD_AD_B0, RT_PAD_AD_B1, 0, 0},
        {RT_PAD_AD_B1, RT_PAD_B0, 0, 16},
        {RT_PAD_B0, RT_PAD_B1, 1, 0},
        {RT_PAD_B1, RT_PAD_SD_B0, 1, 16},
        {RT_PAD_SD_B0, RT_PAD_SD_B1, 2, 12},
        {RT_PAD_SD_B1, RT_PADS, 2, 0},
    };
    uint32_t range = 0;
    while (pad >= ranges[range].end) {
        range++;
    }
    *bit = ranges[range].bit + pad - ranges[range].first;
    return ranges[range].port;
}

/* The port that owns the pad. */
static uint32_t owner_of(const rt1062_t *m, uint32_t pad, uint32_t *bit) {
    const uint32_t port = place_of(pad, bit);
    return (m->s.gpr.value[GPR26 + port] >> *bit & 1) != 0 ? port + RT_GPIO_SLOW : port;
}

int rt_gpio_drives(const rt1062_t *m, uint32_t pad) {
    uint32_t bit;
    const rt_gpio_t *port = &m->s.gpio[owner_of(m, pad, &bit)];
    const bool output = (port->direction >> bit & 1) != 0;
    return output ? (int)(port->data >> bit & 1) : RT_FLOATING;
}

/* The input path is open for an input, and for whatever SION forces. */
static bool sees_high(const rt1062_t *m, uint32_t pad, uint32_t port, uint32_t bit) {
    uint32_t owner_bit;
    const bool owned = owner_of(m, pad, &owner_bit) == port;
    const bool is_input = rt_pad_is(m, pad, RT_ALT_GPIO) && (m->s.gpio[port].direction >> bit & 1) == 0;
    return owned && (is_input || rt_pad_sion(m, pad)) && m->s.pads.level[pad] == 1;
}

/* ------------------------------------------------------------------ interrupts */

static uint32_t condition(const rt_gpio_t *port, uint32_t bit) {
    return port->condition[bit / 16] >> 2 * (bit % 16) & 3;
}

/* Conditions that hold as long as a level does set their bit again at once, masked or not. */
static void assert_levels(rt_gpio_t *port) {
    port->status |= ~port->both_edges & ((port->on_low & ~port->input) | (port->on_high & port->input));
}

static void sort_conditions(rt_gpio_t *port) {
    port->on_low = 0;
    port->on_high = 0;
    for (uint32_t bit = 0; bit < 32; bit++) {
        port->on_low |= (uint32_t)(condition(port, bit) == ON_LOW) << bit;
        port->on_high |= (uint32_t)(condition(port, bit) == ON_HIGH) << bit;
    }
}

static void update_lines(rt1062_t *m, uint32_t number) {
    rt_gpio_t *port = &m->s.gpio[number];
    assert_levels(port);
    const uint32_t pending = port->status & port->mask;
    if (number < RT_GPIO_SLOW) {
        rt_irq_set(m, IRQ_GPIO1_0_15 + 2 * number, (pending & 0xFFFF) != 0);
        rt_irq_set(m, IRQ_GPIO1_0_15 + 2 * number + 1, pending >> 16 != 0);
        for (uint32_t bit = 0; number == 0 && bit < OWN_LINES; bit++) {
            rt_irq_set(m, IRQ_GPIO1_INT0 + bit, (pending >> bit & 1) != 0);
        }
        return;
    }
    bool any = false;
    for (uint32_t i = RT_GPIO_SLOW; i < RT_GPIO_PORTS; i++) {
        any = any || (m->s.gpio[i].status & m->s.gpio[i].mask) != 0;
    }
    rt_irq_set(m, IRQ_GPIO6789, any);
}

static void take_input(rt1062_t *m, uint32_t number, uint32_t bit, bool high) {
    rt_gpio_t *port = &m->s.gpio[number];
    if ((port->input >> bit & 1) == (uint32_t)high) {
        return;
    }
    port->input ^= 1u << bit;
    const uint32_t wanted = condition(port, bit);
    const bool edge = (port->both_edges >> bit & 1) != 0 || wanted == (uint32_t)(high ? ON_RISE : ON_FALL);
    if (edge) {
        port->status |= 1u << bit;
    }
    update_lines(m, number);
}

void rt_gpio_input_changed(rt1062_t *m, uint32_t pad) {
    uint32_t bit;
    const uint32_t port = place_of(pad, &bit);
    take_input(m, port, bit, sees_high(m, pad, port, bit));
    take_input(m, port + RT_GPIO_SLOW, bit, sees_high(m, pad, port + RT_GPIO_SLOW, bit));
}

void rt_gpio_owners_changed(rt1062_t *m) {
    for (uint32_t pad = 0; pad < RT_PADS; pad++) {
        rt_pad_update(m, pad);
    }
}

/* ------------------------------------------------------------------ registers */

static void update_pads(rt1062_t *m, uint32_t number, uint32_t bits) {
    for (uint32_t pad = 0; pad < RT_PADS && bits != 0; pad++) {
        uint32_t bit;
        if (place_of(pad, &bit) == number % RT_GPIO_SLOW && (bits >> bit & 1) != 0) {
            rt_pad_update(m, pad);
        }
    }
}

/* DR shows the pad of an input whose pad is switched to GPIO, and what was written for an output. */
static uint32_t read_data(const rt1062_t *m, uint32_t number) {
    const rt_gpio_t *port = &m->s.gpio[number];
    uint32_t inputs = port->input & ~port->direction;
    for (uint32_t pad = 0; pad < RT_PADS && inputs != 0; pad++) {
        uint32_t bit;
        if (place_of(pad, &bit) == number % RT_GPIO_SLOW && !rt_pad_is(m, pad, RT_ALT_GPIO)) {
            inputs &= ~(1u << bit);
        }
    }
    return (port->data & port->direction) | inputs;
}

static bool clocked(rt1062_t *m, uint32_t number) {
    static const rt_clock_gate_t gates[RT_GPIO_SLOW] = {RT_CLOCK_GPIO1, RT_CLOCK_GPIO2, RT_CLOCK_GPIO3, RT_CLOCK_GPIO4};
    static const char *const names[RT_GPIO_SLOW] = {"GPIO1", "GPIO2", "GPIO3", "GPIO4"};
    /* The fast ones run with the processor. */
    return number >= RT_GPIO_SLOW || rt_clock_needed(m, gates[number], names[number]);
}

static bool read_port(rt1062_t *m, uint32_t number, uint32_t offset, uint32_t size, uint32_t *value) {
    rt_gpio_t *port = &m->s.gpio[number];
    if (size != 4) {
        return false;
    }
    *value = 0;
    if (!clocked(m, number)) {
        return true;
    }
    if (number % RT_GPIO_SLOW == 0) {
        rt_i2c_sync(m); /* the bus is on this port */
    }
    switch (offset) {
    case DR:
        *value = read_data(m, number);
        return true;
    case GDIR:
        *value = port->direction;
        return true;
    case PSR:
        *value = port->input;
        return true;
    case ICR1:
    case ICR2:
        *value = port->condition[(offset - ICR1) / 4];
        return true;
    case IMR:
        *value = port->mask;
        return true;
    case ISR:
        assert_levels(port);
        *value = port->status;
        return true;
    case EDGE_SEL:
        *value = port->both_edges;
        return true;
    default:
        return false; /* DR_SET, DR_CLEAR, DR_TOGGLE: write-only */
    }
}

static void write_data(rt1062_t *m, uint32_t number, uint32_t value) {
    rt_gpio_t *port = &m->s.gpio[number];
    const uint32_t changed = port->data ^ value;
    port->data = value;
    update_pads(m, number, changed);
}

/* @return false: no such register. */
static bool write_interrupts(rt1062_t *m, uint32_t number, uint32_t offset, uint32_t value) {
    rt_gpio_t *port = &m->s.gpio[number];
    switch (offset) {
    case ICR1:
    case ICR2:
        port->condition[(offset - ICR1) / 4] = value;
        sort_conditions(port);
        break;
    case IMR:
        port->mask = value;
        break;
    case ISR:
        port->status &= ~value;
        break;
    case EDGE_SEL:
        port->both_edges = value;
        break;
    default:
        return false;
    }
    update_lines(m, number);
    return true;
}

static bool write_port(rt1062_t *m, uint32_t number, uint32_t offset, uint32_t size, uint32_t value) {
    rt_gpio_t *port = &m->s.gpio[number];
    if (size != 4) {
        return false;
    }
    if (!clocked(m, number)) {
        return true;
    }
    const bool at_bus = number % RT_GPIO_SLOW == 0;
    if (at_bus) {
        rt_i2c_sync(m);
    }
    bool known = true;
    if (offset == DR) {
        write_data(m, number, value);
    } else if (offset == DR_SET) {
        write_data(m, number, port->data | value);
    } else if (offset == DR_CLEAR) {
        write_data(m, number, port->data & ~value);
    } else if (offset == DR_TOGGLE) {
        write_data(m, number, port->data ^ value);
    } else if (offset == GDIR) {
        const uint32_t changed = port->direction ^ value;
        port->direction = value;
        update_pads(m, number, changed);
    } else {
        known = write_interrupts(m, number, offset, value);
    }
    if (at_bus) {
        rt_i2c_sync(m);
    }
    return known;
}

static bool read_slow(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    return read_port(m, offset / SPACING, offset % SPACING, size, value);
}

static bool write_slow(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    return write_port(m, offset / SPACING, offset % SPACING, size, value);
}

static bool read_fast(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    return read_port(m, RT_GPIO_SLOW + offset / SPACING, offset % SPACING, size, value);
}

static bool write_fast(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    return write_port(m, RT_GPIO_SLOW + offset / SPACING, offset % SPACING, size, value);
}

static void reset(rt1062_t *m) {
    for (uint32_t i = 0; i < RT_GPIO_PORTS; i++) {
        m->s.gpio[i] = (rt_gpio_t){0};
        sort_conditions(&m->s.gpio[i]);
    }
}

const rt_device_t rt_gpio_slow = {"GPIO1..4", 0x401B8000, 4 * SPACING, read_slow, write_slow, reset};
const rt_device_t rt_gpio_fast = {"GPIO6..9", 0x42000000, 4 * SPACING, read_fast, write_fast, NULL};
