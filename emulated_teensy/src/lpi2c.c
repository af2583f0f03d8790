/* SPDX-License-Identifier: MIT */
/* The registers of LPI2C1, LPI2C3 and LPI2C4; i2c_master.c plays the buses. */
#include "lpi2c.h"

#include "clocks.h"
#include "devices.h"
#include "i2c_master.h"
#include "machine.h"
#include "pads.h"

enum {
    MCR = 0x10,
    MSR = 0x14,
    MIER = 0x18,
    MCFGR0 = 0x20,
    MCFGR3 = 0x2C,
    MCCR0 = 0x48,
    MFCR = 0x58,
    MFSR = 0x5C,
    MTDR = 0x60,
    MRDR = 0x70,
    MCR_RST = 1 << 1,
    MCR_MODES = 3 << 2, /* DOZEN, DBGEN: neither doze nor debugging happens here */
    MCR_RTF = 1 << 8,
    MCR_RRF = 1 << 9,
    MRDR_RXEMPTY = 1 << 14,
    MTDR_START = 4,
    MTDR_MASK = 0x7FF,
    ENABLES = 0x7F03,
    WATER = 0x00030003,
    MCCR0_MASK = 0x3F3F3F3F
};

/* Bits that the model knows: MCFGR0 none; PRESCALE; FILTSDA, FILTSCL, BUSIDLE; PINLOW. */
static const uint32_t config_bits[] = {0, 0x7, 0x0F0F0FFF, 0x000FFF00};

static bool clocked(rt1062_t *m, uint32_t number) {
    return rt_clock_needed(m, (rt_clock_gate_t)rt_i2c_units[number].clock, rt_i2c_units[number].name);
}

/* ------------------------------------------------------------------ reading */

static uint32_t take_received(rt_i2c_t *bus) {
    if (bus->received_count == 0) {
        return MRDR_RXEMPTY;
    }
    const uint32_t first = bus->received[0];
    bus->received_count--;
    for (uint32_t i = 0; i < bus->received_count; i++) {
        bus->received[i] = bus->received[i + 1];
    }
    return first;
}

static bool read_register(rt_i2c_t *bus, uint32_t offset, uint32_t *value) {
    switch (offset) {
    case MCR:
        *value = bus->control | (bus->in_reset ? (uint32_t)MCR_RST : 0u);
        return true;
    case MSR:
        *value = rt_i2c_status(bus);
        return true;
    case MIER:
        *value = bus->enables;
        return true;
    case MCCR0:
        *value = bus->clock;
        return true;
    case MFCR:
        *value = bus->water;
        return true;
    case MFSR:
        *value = bus->command_count | bus->received_count << 16;
        return true;
    case MRDR:
        *value = take_received(bus);
        return true;
    default:
        if (offset < MCFGR0 || offset > MCFGR3) {
            return false;
        }
        *value = bus->config[(offset - MCFGR0) / 4];
        return true;
    }
}

static bool read(rt1062_t *m, uint32_t number, uint32_t offset, uint32_t size, uint32_t *value) {
    *value = 0;
    if (size != 4) {
        return false;
    }
    if (!clocked(m, number)) {
        return true;
    }
    rt_i2c_sync(m);
    const bool known = read_register(&m->s.i2c[number], offset, value);
    rt_i2c_sync(m);
    return known;
}

/* ------------------------------------------------------------------ writing */

/* RST: everything but MCR as after power-on, the lines let go. */
static void reset_master(rt1062_t *m, uint32_t number) {
    rt_i2c_t *bus = &m->s.i2c[number];
    const uint64_t at_ps = bus->at_ps;
    const uint32_t control = bus->control;
    *bus = (rt_i2c_t){.at_ps = at_ps, .end_ps = RT_NEVER, .control = control};
    rt_pad_update(m, rt_i2c_units[number].pad[RT_SCL]);
    rt_pad_update(m, rt_i2c_units[number].pad[RT_SDA]);
    rt_i2c_listen(m, bus);
}

static bool write_control(rt1062_t *m, uint32_t number, uint32_t value) {
    rt_i2c_t *bus = &m->s.i2c[number];
    if ((value & ~(uint32_t)(RT_MCR_MEN | MCR_RST | MCR_MODES | MCR_RTF | MCR_RRF)) != 0) {
        return false;
    }
    if ((value & MCR_RST) != 0) {
        reset_master(m, number);
    } else if (bus->busy && (value & RT_MCR_MEN) == 0) {
        rt_refuse(m, "%s is switched off between START and STOP", rt_i2c_units[number].name);
    }
    bus->in_reset = (value & MCR_RST) != 0;
    bus->control = value & (uint32_t)(RT_MCR_MEN | MCR_MODES);
    bus->command_count = (value & MCR_RTF) != 0 ? 0 : bus->command_count;
    bus->received_count = (value & MCR_RRF) != 0 ? 0 : bus->received_count;
    return true;
}

/* RM: "should only be written when the I2C master is disabled". */
static bool write_timing(rt1062_t *m, uint32_t number, uint32_t *place, uint32_t value, uint32_t known_bits) {
    if ((value & ~known_bits) != 0) {
        return false;
    }
    if ((m->s.i2c[number].control & RT_MCR_MEN) != 0 && value != *place) {
        rt_refuse(m, "the timing of %s is written while it is enabled", rt_i2c_units[number].name);
    }
    *place = value;
    return true;
}

static void expect_pins(rt1062_t *m, uint32_t number) {
    for (uint32_t line = 0; line < 2; line++) {
        if (!rt_i2c_hears(m, &m->s.i2c[number], line)) {
            rt_finding(m, RT1062_FINDING_PINS,
                       "%s is to begin, but its %s reaches no pin: check mux, SION and SELECT_INPUT",
                       rt_i2c_units[number].name, line == RT_SCL ? "SCL" : "SDA");
        }
    }
}

static bool write_command(rt1062_t *m, uint32_t number, uint32_t value) {
    rt_i2c_t *bus = &m->s.i2c[number];
    const uint32_t command = value >> 8 & 7;
    if ((value & ~(uint32_t)MTDR_MASK) != 0 || command == 3 || command > MTDR_START) {
        return false; /* discarding, expected NACKs, high speed: not modelled */
    }
    if (bus->command_count == RT_I2C_FIFO) {
        rt_refuse(m, "%s gets a fifth command while four are waiting", rt_i2c_units[number].name);
        return true;
    }
    if (command == MTDR_START) {
        expect_pins(m, number);
    }
    bus->commands[bus->command_count++] = (uint16_t)value;
    return true;
}

static bool write_register(rt1062_t *m, uint32_t number, uint32_t offset, uint32_t value) {
    rt_i2c_t *bus = &m->s.i2c[number];
    switch (offset) {
    case MCR:
        return write_control(m, number, value);
    case MSR:
        bus->flags &= ~value;
        return true;
    case MIER:
        bus->enables = value;
        return (value & ~(uint32_t)ENABLES) == 0;
    case MCCR0:
        return write_timing(m, number, &bus->clock, value, MCCR0_MASK);
    case MFCR:
        bus->water = value;
        return (value & ~(uint32_t)WATER) == 0;
    case MTDR:
        return write_command(m, number, value);
    default:
        return offset >= MCFGR0 && offset <= MCFGR3 &&
               write_timing(m, number, &bus->config[(offset - MCFGR0) / 4], value, config_bits[(offset - MCFGR0) / 4]);
    }
}

static bool write(rt1062_t *m, uint32_t number, uint32_t offset, uint32_t size, uint32_t value) {
    if (size != 4) {
        return false;
    }
    if (!clocked(m, number)) {
        return true;
    }
    rt_i2c_sync(m);
    if (m->s.i2c[number].in_reset && offset != MCR) {
        rt_refuse(m, "%s is written to while MCR.RST holds it in reset", rt_i2c_units[number].name);
        return true;
    }
    const bool known = write_register(m, number, offset, value);
    rt_i2c_sync(m);
    return known;
}

static void reset(rt1062_t *m, uint32_t number) {
    m->s.i2c[number] = (rt_i2c_t){.at_ps = rt_now(m) * 1000, .end_ps = RT_NEVER};
}

/* ------------------------------------------------------------------ the three of them */

static bool read_motors(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    return read(m, 0, offset, size, value);
}

static bool write_motors(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    return write(m, 0, offset, size, value);
}

static void reset_motors(rt1062_t *m) {
    reset(m, 0);
}

static bool read_gyro(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    return read(m, 1, offset, size, value);
}

static bool write_gyro(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    return write(m, 1, offset, size, value);
}

static void reset_gyro(rt1062_t *m) {
    reset(m, 1);
}

static bool read_flow(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    return read(m, 2, offset, size, value);
}

static bool write_flow(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    return write(m, 2, offset, size, value);
}

static void reset_flow(rt1062_t *m) {
    reset(m, 2);
}

const rt_device_t rt_lpi2c1 = {"LPI2C1", 0x403F0000, 0x4000, read_motors, write_motors, reset_motors};
const rt_device_t rt_lpi2c3 = {"LPI2C3", 0x403F8000, 0x4000, read_gyro, write_gyro, reset_gyro};
const rt_device_t rt_lpi2c4 = {"LPI2C4", 0x403FC000, 0x4000, read_flow, write_flow, reset_flow};
