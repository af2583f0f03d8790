/* SPDX-License-Identifier: MIT */
/* What others call: see emulated_teensy/rt1062.h. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "links.h"
#include "machine.h"

enum { POWER_ON_degC = 40 };

rt1062_t *rt1062_new(const char *unicorn_library, const rt1062_config_t *config, char *why, uint32_t why_size) {
    rt1062_t *m = calloc(1, sizeof *m);
    if (m == NULL) {
        snprintf(why, why_size, "out of memory");
        return NULL;
    }
    m->config = *config;
    if (config->instruction_ns < 1 || config->instruction_ns > 1000) {
        snprintf(why, why_size, "instruction_ns is %u; 1 to 1000 are possible", (unsigned)config->instruction_ns);
    } else if (rt_unicorn_open(&m->api, unicorn_library, why, why_size) && rt_cpu_open(m, why, why_size)) {
        return m;
    }
    rt1062_free(m);
    return NULL;
}

void rt1062_free(rt1062_t *m) {
    if (m != NULL) {
        rt_cpu_close(m);
        rt_unicorn_close(&m->api);
        free(m);
    }
}

uint8_t *rt1062_flash(rt1062_t *m) {
    return m->flash;
}

/* ------------------------------------------------------------------ running */

/* RAM comes up with anything in it. Xorshift: no quality is asked for. */
static void fill_with_noise(uint8_t *bytes, uint32_t size, uint64_t *state) {
    for (uint32_t i = 0; i < size; i += 8) {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        memcpy(bytes + i, state, 8);
    }
}

bool rt1062_power_on(rt1062_t *m) {
    uint64_t noise = m->config.seed * 2 + 1;
    rt_nor_power_lost(m);
    const rt_nor_t nor = m->s.nor;
    memset(&m->s, 0, sizeof m->s);
    m->s.nor = nor; /* the flash chip's wear and an agreed power cut are none of the processor's */
    m->s.analog.temperature_degC = POWER_ON_degC;
    m->stopping = false;
    m->why[0] = '\0';
    fill_with_noise(m->itcm, RT_ITCM_SIZE, &noise);
    fill_with_noise(m->dtcm, RT_DTCM_SIZE, &noise);
    fill_with_noise(m->ocram, RT_OCRAM_SIZE, &noise);
    memset(m->blocks, 0, sizeof m->blocks);
    m->api.control(m->engine, RT_UC_CTL_FLUSH_CACHE);
    m->s.powered = true;
    rt_reset_now(m, RT_RESET_POWER);
    return !m->stopping;
}

bool rt1062_powered(const rt1062_t *m) {
    return m->s.powered;
}

static void do_reset(rt1062_t *m) {
    rt_reset_now(m, m->s.reset_wanted);
    if ((m->stop_on >> RT1062_STOP_RESET & 1) != 0) {
        rt_stop(m, RT1062_STOP_RESET);
    }
}

/* Nothing runs until the next event. */
static void idle(rt1062_t *m, uint64_t until_ns) {
    const uint64_t next = rt_next_event(m);
    const uint64_t to = next < until_ns ? next : until_ns;
    m->s.now_ns = to > m->s.now_ns ? to : m->s.now_ns;
}

static void advance(rt1062_t *m) {
    rt_events_run(m);
    if (m->s.reset_wanted != 0) {
        do_reset(m);
        return;
    }
    rt_protection_apply(m);
    if (!m->s.locked_up) {
        rt_exceptions_take(m);
    }
    if (m->stopping || m->s.now_ns >= m->until_ns) {
        return;
    }
    if (m->s.sleeping || m->s.locked_up) {
        idle(m, m->until_ns);
        return;
    }
    const uint64_t next = rt_next_event(m);
    rt_cpu_slice(m, next < m->until_ns ? next : m->until_ns);
}

rt1062_stop_t rt1062_run(rt1062_t *m, uint64_t until_ns) {
    if (!m->s.powered) {
        snprintf(m->why, sizeof m->why, "the power is off");
        return RT1062_STOP_POWER;
    }
    m->stopping = false;
    m->stop = RT1062_STOP_TIME;
    m->until_ns = until_ns;
    while (!m->stopping && m->s.now_ns < until_ns) {
        advance(m);
    }
    if (m->stop == RT1062_STOP_POWER) {
        m->s.powered = false;
    }
    return m->stop;
}

uint64_t rt1062_time_ns(const rt1062_t *m) {
    return m->s.now_ns;
}

uint64_t rt1062_instructions(const rt1062_t *m) {
    return m->s.instructions;
}

const char *rt1062_why(const rt1062_t *m) {
    return m->why;
}

void rt1062_stop_on(rt1062_t *m, uint32_t stops) {
    m->stop_on = stops;
}

bool rt1062_break(rt1062_t *m, uint32_t address) {
    if (address == 0) {
        m->break_count = 0;
        return true;
    }
    if (m->break_count == RT_BREAKS) {
        return false;
    }
    m->break_at[m->break_count++] = address & ~1u;
    return true;
}

void rt1062_stack_end(rt1062_t *m, uint32_t address) {
    m->stack_end = address;
    m->stack_left = UINT32_MAX;
}

uint32_t rt1062_stack_left(const rt1062_t *m) {
    return m->stack_end == 0 ? UINT32_MAX : m->stack_left;
}

void rt1062_pace(rt1062_t *m, uint32_t address, uint32_t pause_ns) {
    m->pace_at = address & ~1u;
    m->pace_ns = pause_ns;
}

/* ------------------------------------------------------------------ looking inside */

uint32_t rt1062_register(rt1062_t *m, uint32_t number) {
    static const int special[] = {RT_REG_SP, RT_REG_LR, RT_REG_PC, RT_REG_XPSR};
    if (number <= 12) {
        return rt_reg(m, RT_REG_R0 + (int)number);
    }
    return number <= 16 ? rt_reg(m, special[number - 13]) : 0;
}

bool rt1062_read(rt1062_t *m, uint32_t address, uint8_t *bytes, uint32_t count) {
    const uint8_t *memory = rt_memory(m, address, count);
    if (memory != NULL) {
        memcpy(bytes, memory, count);
    }
    return memory != NULL;
}

bool rt1062_write(rt1062_t *m, uint32_t address, const uint8_t *bytes, uint32_t count) {
    uint8_t *memory = rt_memory(m, address, count);
    if (memory != NULL) {
        memcpy(memory, bytes, count);
        rt_code_changed(m, address, count);
    }
    return memory != NULL;
}

uint32_t rt1062_bus_read(rt1062_t *m, uint32_t address, uint32_t size) {
    m->stopping = false;
    m->stop = RT1062_STOP_TIME;
    return rt_bus_read(m, address, size);
}

bool rt1062_bus_write(rt1062_t *m, uint32_t address, uint32_t size, uint32_t value) {
    m->stopping = false;
    m->stop = RT1062_STOP_TIME;
    rt_bus_write(m, address, size, value);
    return !m->stopping;
}

uint32_t rt1062_findings(const rt1062_t *m) {
    return m->s.finding_count;
}

const rt1062_finding_t *rt1062_finding(const rt1062_t *m, uint32_t number) {
    return number < m->s.finding_count ? &m->s.finding[number] : NULL;
}

void rt1062_forget_findings(rt1062_t *m) {
    m->s.finding_count = 0;
}

const char *const *rt1062_not_modelled(void) {
    static const char *const sentences[] = {
        "Caches, write buffers and the order in which writes reach the bus.",
        "Cycle times: every instruction takes the same time.",
        "The flash controller's read buffers: a program that leaves out their purge after a write is not found.",
        "Times that no manual gives: the boot ROM takes 5 ms, at power-on 55 ms; PLLs and supplies take set times.",
        "Analog behaviour: edges, levels between high and low, noise, supply currents.",
        "The 500 us that the PWM chip's oscillator takes to start.",
        "Levels of the serial port's pins: its bytes go past them.",
        "Flash memory after a cut: bits are old or new. A real chip's may change from one read to the next.",
        "An interrupt between LDREX and STREX: STREX fails only if the value has changed.",
        "A fault by alignment, or in a protected region smaller than a page: the rest of the basic block runs.",
        "Cumulative exception flags of double-precision operations; whether the floating-point unit was switched on.",
        "Peripherals that the image does not use: touching one ends the run.",
        NULL,
    };
    return sentences;
}

/* ------------------------------------------------------------------ bytes out */

void rt_output(rt1062_t *m, rt1062_channel_t channel, const uint8_t *bytes, uint32_t count) {
    rt1062_output_t *output = &m->output[channel];
    const uint32_t room = RT1062_OUTPUT_SIZE - output->count;
    const uint32_t taken =
        count < room ? count : room; /* nobody listens: what is not read in time is lost, as on a wire */
    memcpy(output->bytes + output->count, bytes, taken);
    output->count += taken;
    if ((m->stop_on >> RT1062_STOP_OUTPUT & 1) != 0) {
        rt_stop(m, RT1062_STOP_OUTPUT);
    }
}

uint32_t rt1062_receive(rt1062_t *m, rt1062_channel_t channel, uint8_t *bytes, uint32_t room) {
    rt1062_output_t *output = &m->output[channel];
    const uint32_t count = output->count < room ? output->count : room;
    memcpy(bytes, output->bytes, count);
    output->count -= count;
    memmove(output->bytes, output->bytes + count, output->count);
    if (channel == RT1062_USB) {
        rt_usb_host_look(m);
    }
    return count;
}

uint32_t rt1062_send(rt1062_t *m, rt1062_channel_t channel, const uint8_t *bytes, uint32_t count) {
    return channel == RT1062_USB ? rt_usb_send(m, bytes, count) : rt_uart_send(m, bytes, count);
}
