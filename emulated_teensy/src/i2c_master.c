/* SPDX-License-Identifier: MIT */
/*
 * LPI2C1, LPI2C3 and LPI2C4 as masters: from commands to edges. Durations: RM, chapter LPI2C, "Timing Parameters". In
 * prescaled clocks, with a latency of (2 + FILTSCL + rise time) / 2^PRESCALE, rounded down, from letting a line go to
 * seeing it high. The lines rise as fast as UM10204 lets them.
 */
#include "i2c_master.h"

#include "clocks.h"
#include "handlers.h"
#include "i2c_chip.h"
#include "pads.h"

enum {
    TRANSMIT = 0,
    RECEIVE = 1,
    STOP = 2,
    ACKNOWLEDGE = 8, /* number of that bit */
    RISE_ns = 20,    /* UM10204, table 10, fast mode: the least */
    HALTS = RT_MSR_NDF | RT_MSR_ALF | RT_MSR_FEF | RT_MSR_PLTF
};

/* [core] imxrt.h: interrupts; WireIMXRT.cpp: alternatives and daisy values. */
const rt_i2c_unit_t rt_i2c_units[RT_I2C_UNITS] = {
    {"LPI2C1", RT_CLOCK_LPI2C1, 28, {RT_PAD_SCL, RT_PAD_SDA}, 3, {RT_DAISY_LPI2C1_SCL, RT_DAISY_LPI2C1_SDA}, 1},
    {"LPI2C3", RT_CLOCK_LPI2C3, 30, {RT_PAD_SCL3, RT_PAD_SDA3}, 1, {RT_DAISY_LPI2C3_SCL, RT_DAISY_LPI2C3_SDA}, 2},
    {"LPI2C4", RT_CLOCK_LPI2C4, 31, {RT_PAD_SCL4, RT_PAD_SDA4}, 0, {RT_DAISY_LPI2C4_SCL, RT_DAISY_LPI2C4_SDA}, 1},
};

static const rt_i2c_unit_t *unit_of(const rt1062_t *m, const rt_i2c_t *bus) {
    return &rt_i2c_units[bus - m->s.i2c];
}

/* The bus that a pad belongs to; RT_I2C_UNITS: none. */
static uint32_t unit_at(uint32_t pad) {
    uint32_t unit = 0;
    while (unit < RT_I2C_UNITS && pad != rt_i2c_units[unit].pad[RT_SCL] && pad != rt_i2c_units[unit].pad[RT_SDA]) {
        unit++;
    }
    return unit;
}

/* ------------------------------------------------------------------ timing */

static uint32_t prescale(const rt_i2c_t *bus) {
    return bus->config[1] & 7;
}

static uint64_t clocks_ps(const rt1062_t *m, const rt_i2c_t *bus, uint64_t clocks) {
    const uint32_t clock_Hz = rt_clock_hz(m, RT_ROOT_LPI2C);
    return clock_Hz == 0 ? RT_NEVER / 4 : (clocks << prescale(bus)) * UINT64_C(1000000000000) / clock_Hz;
}

static uint32_t low_clocks(const rt_i2c_t *bus) {
    return (bus->clock & 0x3F) + 1;
}

static uint32_t high_clocks(const rt_i2c_t *bus) {
    return (bus->clock >> 8 & 0x3F) + 1;
}

static uint32_t hold_clocks(const rt_i2c_t *bus) {
    return (bus->clock >> 16 & 0x3F) + 1;
}

/* From SCL's fall to SDA's change; within the low time. */
static uint32_t valid_clocks(const rt_i2c_t *bus) {
    const uint32_t valid = (bus->clock >> 24 & 0x3F) + 1;
    return valid < low_clocks(bus) ? valid : low_clocks(bus);
}

static uint32_t latency(const rt1062_t *m, const rt_i2c_t *bus, uint32_t line) {
    const uint32_t filter = bus->config[2] >> (line == RT_SCL ? 16 : 24) & 0xF;
    const uint32_t rise = rt_clock_hz(m, RT_ROOT_LPI2C) / 1000 * RISE_ns / 1000000;
    return (2 + filter + rise) >> prescale(bus);
}

static uint64_t bus_idle_ps(const rt1062_t *m, const rt_i2c_t *bus) {
    const uint32_t clocks = bus->config[2] & 0xFFF;
    return clocks == 0 ? RT_NEVER / 4 : clocks_ps(m, bus, clocks);
}

static uint64_t pin_low_ps(const rt1062_t *m, const rt_i2c_t *bus) {
    const uint32_t clocks = bus->config[3] & 0xFFF00; /* PINLOW, in 256 clocks */
    return clocks == 0 ? RT_NEVER / 4 : clocks_ps(m, bus, clocks);
}

/* ------------------------------------------------------------------ lines */

bool rt_i2c_hears(const rt1062_t *m, const rt_i2c_t *bus, uint32_t line) {
    const rt_i2c_unit_t *unit = unit_of(m, bus);
    return rt_pad_is(m, unit->pad[line], unit->alternative) && rt_pad_sion(m, unit->pad[line]) &&
           m->s.pads.daisy[unit->daisy[line]] == unit->daisy_value;
}

int rt_i2c_drives(const rt1062_t *m, uint32_t pad) {
    const uint32_t number = unit_at(pad);
    if (number == RT_I2C_UNITS || !rt_pad_is(m, pad, rt_i2c_units[number].alternative)) {
        return RT_FLOATING;
    }
    const uint32_t line = pad == rt_i2c_units[number].pad[RT_SCL] ? RT_SCL : RT_SDA;
    return m->s.i2c[number].pulls[line] ? 0 : RT_FLOATING;
}

/* START and STOP of anybody: SDA moves while SCL is high. */
void rt_i2c_listen(rt1062_t *m, rt_i2c_t *bus) {
    const bool before[2] = {bus->line[RT_SCL], bus->line[RT_SDA]};
    for (uint32_t line = 0; line < 2; line++) {
        bus->line[line] = rt_i2c_hears(m, bus, line) && m->s.pads.level[unit_of(m, bus)->pad[line]] == 1;
        bus->changed_ps[line] = bus->line[line] != before[line] ? bus->at_ps : bus->changed_ps[line];
    }
    const bool enabled = (bus->control & RT_MCR_MEN) != 0;
    if (enabled && before[RT_SCL] && bus->line[RT_SCL] && before[RT_SDA] != bus->line[RT_SDA]) {
        bus->bus_busy = before[RT_SDA];
    }
}

static void trace(rt1062_t *m) {
    rt_i2c_trace_t *trace = &m->i2c_trace;
    if (trace->count < RT1062_EDGES) {
        trace->edge[trace->count++] =
            (rt1062_edge_t){m->s.i2c[0].at_ps, m->s.pads.level[RT_PAD_SCL], m->s.pads.level[RT_PAD_SDA]};
    }
}

void rt_i2c_line_changed(rt1062_t *m, uint32_t pad) {
    const uint32_t number = unit_at(pad);
    if (number == RT_I2C_UNITS) {
        return;
    }
    if (number == 0) {
        trace(m);
    }
    const uint8_t *pads = rt_i2c_units[number].pad;
    rt_i2c_listen(m, &m->s.i2c[number]);
    rt_i2c_chip_lines(m, number, m->s.pads.level[pads[RT_SCL]] != 0, m->s.pads.level[pads[RT_SDA]] != 0);
}

static void pull(rt1062_t *m, rt_i2c_t *bus, uint32_t line, bool low) {
    if (bus->pulls[line] != low) {
        bus->pulls[line] = low;
        rt_pad_update(m, unit_of(m, bus)->pad[line]);
    }
}

/* ------------------------------------------------------------------ commands */

uint32_t rt_i2c_status(const rt_i2c_t *bus) {
    uint32_t status =
        bus->flags | (bus->busy ? (uint32_t)RT_MSR_MBF : 0u) | (bus->bus_busy ? (uint32_t)RT_MSR_BBF : 0u);
    status |= bus->command_count <= (bus->water & 3) ? RT_MSR_TDF : 0u;
    return status | (bus->received_count > (bus->water >> 16 & 3) ? (uint32_t)RT_MSR_RDF : 0u);
}

static void enter(rt1062_t *m, rt_i2c_t *bus, rt_i2c_phase_t phase, uint64_t clocks) {
    bus->phase = phase;
    bus->end_ps = bus->at_ps + clocks_ps(m, bus, clocks);
}

static void await(rt_i2c_t *bus, rt_i2c_phase_t phase) {
    bus->phase = phase;
    bus->end_ps = RT_NEVER;
}

/* SCL is low: make a bit, a repeated START or a STOP. */
static void begin(rt1062_t *m, rt_i2c_t *bus, rt_i2c_aim_t aim) {
    bus->aim = aim;
    enter(m, bus, RT_I2C_LOW, valid_clocks(bus));
}

static void begin_byte(rt1062_t *m, rt_i2c_t *bus, uint8_t byte, bool reading) {
    bus->byte = byte;
    bus->bit = 0;
    bus->reading = reading;
    begin(m, bus, RT_I2C_BIT);
}

static uint32_t pop(rt_i2c_t *bus) {
    const uint32_t first = bus->commands[0];
    bus->command_count--;
    for (uint32_t i = 0; i < bus->command_count; i++) {
        bus->commands[i] = bus->commands[i + 1];
    }
    return first;
}

static bool next_is_receive(const rt_i2c_t *bus) {
    return bus->command_count > 0 && bus->commands[0] >> 8 == RECEIVE;
}

/* @return false: there is nothing to do yet. */
static bool next_in_transfer(rt1062_t *m, rt_i2c_t *bus) {
    if (bus->bytes_left > 0) {
        if (bus->received_count == RT_I2C_FIFO) {
            return false;
        }
        begin_byte(m, bus, 0, true);
        return true;
    }
    if ((bus->flags & HALTS) != 0) {
        begin(m, bus, RT_I2C_STOP);
        return true;
    }
    if (bus->command_count == 0) {
        return false;
    }
    const uint32_t command = pop(bus);
    switch (command >> 8) {
    case TRANSMIT:
        begin_byte(m, bus, (uint8_t)command, false);
        break;
    case RECEIVE:
        bus->bytes_left = (command & 0xFF) + 1;
        return next_in_transfer(m, bus);
    case STOP:
        begin(m, bus, RT_I2C_STOP);
        break;
    default:
        bus->byte = (uint8_t)command;
        begin(m, bus, RT_I2C_RESTART);
        break;
    }
    return true;
}

/* When a START may begin, as far as it is known now. */
static uint64_t start_ps(const rt1062_t *m, const rt_i2c_t *bus) {
    if (!bus->line[RT_SCL] || !bus->line[RT_SDA]) {
        return RT_NEVER;
    }
    const uint64_t changed_ps =
        bus->changed_ps[RT_SCL] > bus->changed_ps[RT_SDA] ? bus->changed_ps[RT_SCL] : bus->changed_ps[RT_SDA];
    const uint64_t idle_ps = bus->bus_busy ? changed_ps + bus_idle_ps(m, bus) : 0;
    const uint64_t free_ps = bus->free_ps > idle_ps ? bus->free_ps : idle_ps;
    return free_ps > bus->at_ps ? free_ps : bus->at_ps;
}

/* @return false: nothing to do until `until_ps`. */
static bool next_in_idle(rt1062_t *m, rt_i2c_t *bus, uint64_t until_ps) {
    if (bus->command_count == 0 || (bus->flags & HALTS) != 0) {
        return false;
    }
    const uint32_t command = bus->commands[0] >> 8;
    if (command <= STOP) {
        pop(bus);
        bus->flags |= command == STOP ? 0u : (uint32_t)RT_MSR_FEF; /* data without a START */
        return true;
    }
    if (start_ps(m, bus) > until_ps) {
        return false;
    }
    bus->at_ps = start_ps(m, bus);
    bus->byte = (uint8_t)pop(bus);
    bus->busy = true;
    pull(m, bus, RT_SDA, true);
    enter(m, bus, RT_I2C_START_HOLD, hold_clocks(bus));
    return true;
}

/* ------------------------------------------------------------------ phases */

static void lose(rt1062_t *m, rt_i2c_t *bus) {
    bus->flags |= RT_MSR_ALF;
    bus->busy = false;
    bus->bytes_left = 0;
    await(bus, RT_I2C_IDLE);
    pull(m, bus, RT_SDA, false);
    pull(m, bus, RT_SCL, false);
}

static bool acknowledges(const rt_i2c_t *bus) {
    return bus->bytes_left > 1 || next_is_receive(bus);
}

/* Level that the master gives SDA in this bit: low, or let go. */
static bool sends_low(const rt_i2c_t *bus) {
    if (bus->bit == ACKNOWLEDGE) {
        return bus->reading && acknowledges(bus);
    }
    return !bus->reading && (bus->byte >> (7 - bus->bit) & 1) == 0;
}

static void change_sda(rt1062_t *m, rt_i2c_t *bus) {
    const bool low = bus->aim == RT_I2C_STOP || (bus->aim == RT_I2C_BIT && sends_low(bus));
    pull(m, bus, RT_SDA, low);
    enter(m, bus, RT_I2C_SETTLE, low_clocks(bus) - valid_clocks(bus));
}

/* SCL has been seen high: take SDA, or set up START or STOP. */
static void seen_high(rt1062_t *m, rt_i2c_t *bus) {
    const bool own_bit = bus->reading == (bus->bit == ACKNOWLEDGE); /* the master's to send */
    const bool let_go = !bus->pulls[RT_SDA];
    if (let_go && !bus->line[RT_SDA] && (bus->aim == RT_I2C_RESTART || (bus->aim == RT_I2C_BIT && own_bit))) {
        lose(m, bus);
    } else if (bus->aim == RT_I2C_BIT) {
        bus->sampled = bus->line[RT_SDA];
        enter(m, bus, RT_I2C_HIGH, high_clocks(bus));
    } else {
        enter(m, bus, RT_I2C_SETUP, hold_clocks(bus));
    }
}

static void byte_over(rt_i2c_t *bus) {
    if (bus->reading) {
        bus->received[bus->received_count++] = bus->byte;
        bus->bytes_left--;
    } else if (bus->sampled) {
        bus->flags |= RT_MSR_NDF;
    }
    await(bus, RT_I2C_WAIT);
}

static void bit_over(rt1062_t *m, rt_i2c_t *bus) {
    pull(m, bus, RT_SCL, true);
    if (bus->bit == ACKNOWLEDGE) {
        byte_over(bus);
        return;
    }
    if (bus->reading) {
        bus->byte = (uint8_t)(bus->byte << 1 | bus->sampled);
    }
    bus->bit++;
    begin(m, bus, RT_I2C_BIT);
}

static void set_up(rt1062_t *m, rt_i2c_t *bus) {
    if (bus->aim == RT_I2C_RESTART) {
        bus->flags |= RT_MSR_EPF;
        pull(m, bus, RT_SDA, true);
        enter(m, bus, RT_I2C_START_HOLD, hold_clocks(bus));
        return;
    }
    bus->free_ps = bus->at_ps + clocks_ps(m, bus, low_clocks(bus) + latency(m, bus, RT_SDA)); /* t_BUF */
    await(bus, RT_I2C_STOP_RISE);
    pull(m, bus, RT_SDA, false);
}

static void stopped(rt_i2c_t *bus) {
    bus->busy = false;
    bus->flags |= RT_MSR_SDF | RT_MSR_EPF;
    await(bus, RT_I2C_IDLE);
}

/* The phase's time is over. */
static void phase_over(rt1062_t *m, rt_i2c_t *bus) {
    switch (bus->phase) {
    case RT_I2C_START_HOLD:
        pull(m, bus, RT_SCL, true);
        begin_byte(m, bus, bus->byte, false);
        break;
    case RT_I2C_LOW:
        change_sda(m, bus);
        break;
    case RT_I2C_SETTLE:
        await(bus, RT_I2C_RISE);
        pull(m, bus, RT_SCL, false);
        break;
    case RT_I2C_SEEN:
        seen_high(m, bus);
        break;
    case RT_I2C_HIGH:
        bit_over(m, bus);
        break;
    case RT_I2C_SETUP:
        set_up(m, bus);
        break;
    default:
        stopped(bus);
        break;
    }
}

/* What waits for a level or a command. @return false: it waits on. */
static bool waiting_over(rt1062_t *m, rt_i2c_t *bus, uint64_t until_ps) {
    switch (bus->phase) {
    case RT_I2C_IDLE:
        return next_in_idle(m, bus, until_ps);
    case RT_I2C_WAIT:
        return next_in_transfer(m, bus);
    case RT_I2C_RISE:
        if (bus->line[RT_SCL]) {
            enter(m, bus, RT_I2C_SEEN, latency(m, bus, RT_SCL));
        }
        return bus->line[RT_SCL];
    default:
        if (bus->line[RT_SDA]) {
            enter(m, bus, RT_I2C_STOP_SEEN, latency(m, bus, RT_SDA));
        }
        return bus->line[RT_SDA];
    }
}

/* ------------------------------------------------------------------ time */

static void watch_times(rt1062_t *m, rt_i2c_t *bus) {
    if (!bus->line[RT_SCL] && bus->at_ps >= bus->changed_ps[RT_SCL] + pin_low_ps(m, bus)) {
        bus->flags |= RT_MSR_PLTF;
    }
    const bool both_high = bus->line[RT_SCL] && bus->line[RT_SDA];
    const uint64_t idle_ps = bus_idle_ps(m, bus);
    if (both_high && bus->at_ps >= bus->changed_ps[RT_SCL] + idle_ps &&
        bus->at_ps >= bus->changed_ps[RT_SDA] + idle_ps) {
        bus->bus_busy = bus->busy;
    }
}

static void play(rt1062_t *m, rt_i2c_t *bus, uint64_t until_ps) {
    while ((bus->control & RT_MCR_MEN) != 0 && !bus->in_reset) {
        if (bus->end_ps != RT_NEVER && bus->end_ps <= until_ps) {
            bus->at_ps = bus->end_ps;
            phase_over(m, bus);
        } else if (bus->end_ps != RT_NEVER || !waiting_over(m, bus, until_ps)) {
            break;
        }
    }
    bus->at_ps = until_ps > bus->at_ps ? until_ps : bus->at_ps;
    watch_times(m, bus);
}

/* Time from the end of this phase to the end of what the master is at, with nobody stretching the clock. */
static uint64_t rest_clocks(const rt1062_t *m, const rt_i2c_t *bus) {
    const uint64_t high = latency(m, bus, RT_SCL) + high_clocks(bus);
    const uint64_t edge = latency(m, bus, RT_SCL) + (bus->aim == RT_I2C_BIT ? high_clocks(bus) : hold_clocks(bus));
    const uint64_t after = bus->aim == RT_I2C_BIT    ? (uint64_t)(ACKNOWLEDGE - bus->bit) * (low_clocks(bus) + high)
                           : bus->aim == RT_I2C_STOP ? latency(m, bus, RT_SDA)
                                                     : 0;
    switch (bus->phase) {
    case RT_I2C_START_HOLD:
        return (ACKNOWLEDGE + 1) * (low_clocks(bus) + high);
    case RT_I2C_LOW:
        return low_clocks(bus) - valid_clocks(bus) + edge + after;
    case RT_I2C_SETTLE:
        return edge + after;
    case RT_I2C_SEEN:
        return edge - latency(m, bus, RT_SCL) + after;
    case RT_I2C_HIGH:
    case RT_I2C_SETUP:
        return after;
    default:
        return 0;
    }
}

/* The next moment at which the program may see something new. */
static uint64_t next_ps(const rt1062_t *m, const rt_i2c_t *bus) {
    const bool ready = bus->phase == RT_I2C_IDLE && bus->command_count > 0 && (bus->flags & HALTS) == 0;
    uint64_t next = bus->end_ps != RT_NEVER ? bus->end_ps + clocks_ps(m, bus, rest_clocks(m, bus))
                    : ready                 ? start_ps(m, bus)
                                            : RT_NEVER;
    const uint64_t low_ps = bus->changed_ps[RT_SCL] + pin_low_ps(m, bus);
    if (!bus->line[RT_SCL] && (bus->flags & RT_MSR_PLTF) == 0 && low_ps < next) {
        next = low_ps;
    }
    return (bus->control & RT_MCR_MEN) == 0 || bus->in_reset || next > RT_NEVER / 8 ? RT_NEVER : next;
}

/* @return when the program may see something new. */
static uint64_t sync_bus(rt1062_t *m, rt_i2c_t *bus) {
    const uint64_t now_ps = rt_now(m) * 1000;
    if (bus->control == 0 && bus->enables == 0 && bus->flags == 0) {
        bus->at_ps = now_ps; /* nobody uses it */
        return RT_NEVER;
    }
    bus->playing = true;
    rt_i2c_listen(m, bus);
    play(m, bus, now_ps);
    bus->playing = false;
    rt_irq_set(m, unit_of(m, bus)->interrupt, (rt_i2c_status(bus) & bus->enables) != 0);
    return next_ps(m, bus);
}

void rt_i2c_sync(rt1062_t *m) {
    uint64_t next = RT_NEVER;
    for (uint32_t number = 0; number < RT_I2C_UNITS; number++) {
        if (m->s.i2c[number].playing) {
            return;
        }
    }
    for (uint32_t number = 0; number < RT_I2C_UNITS; number++) {
        const uint64_t own = sync_bus(m, &m->s.i2c[number]);
        next = own < next ? own : next;
    }
    rt_schedule(m, RT_EVENT_I2C, next == RT_NEVER ? RT_NEVER : (next + 999) / 1000);
}

void rt_i2c_event(rt1062_t *m) {
    rt_i2c_sync(m);
}

uint32_t rt1062_i2c_edges(rt1062_t *m, rt1062_edge_t *edges, uint32_t room) {
    rt_i2c_trace_t *trace = &m->i2c_trace;
    rt_i2c_sync(m);
    const uint32_t count = trace->count < room ? trace->count : room;
    for (uint32_t i = 0; i < count; i++) {
        edges[i] = trace->edge[i];
    }
    trace->count = 0;
    return count;
}
