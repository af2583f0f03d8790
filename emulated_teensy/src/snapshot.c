/* SPDX-License-Identifier: MIT */
/* Copies of the whole machine, and calls of the image's functions. */
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "machine.h"

enum { CORE_REGISTERS = 13 + 3 + 6, FLOATS = 32 };

static const int core_registers[CORE_REGISTERS] = {
    RT_REG_R0,      RT_REG_R0 + 1,  RT_REG_R0 + 2,    RT_REG_R0 + 3, RT_REG_R0 + 4,  RT_REG_R0 + 5,
    RT_REG_R0 + 6,  RT_REG_R0 + 7,  RT_REG_R0 + 8,    RT_REG_R0 + 9, RT_REG_R0 + 10, RT_REG_R0 + 11,
    RT_REG_R0 + 12, RT_REG_SP,      RT_REG_LR,        RT_REG_FPSCR,  RT_REG_CONTROL, RT_REG_IPSR,
    RT_REG_PRIMASK, RT_REG_BASEPRI, RT_REG_FAULTMASK, RT_REG_XPSR};

typedef struct registers_t {
    uint32_t core[CORE_REGISTERS];
    uint32_t floats[FLOATS];
    uint32_t pc;
} registers_t;

struct rt1062_snapshot_t {
    registers_t registers;
    rt_state_t state;
    uint8_t itcm[RT_ITCM_SIZE];
    uint8_t dtcm[RT_DTCM_SIZE];
    uint8_t ocram[RT_OCRAM_SIZE];
    uint8_t flash[RT_FLASH_SIZE];
    max_align_t circuit[]; /* its state */
};

static void save_registers(rt1062_t *m, registers_t *registers) {
    for (uint32_t i = 0; i < CORE_REGISTERS; i++) {
        registers->core[i] = rt_reg(m, core_registers[i]);
    }
    for (uint32_t i = 0; i < FLOATS; i++) {
        registers->floats[i] = rt_reg(m, RT_REG_S0 + (int)i);
    }
    registers->pc = rt_reg(m, RT_REG_PC);
}

static void load_registers(rt1062_t *m, const registers_t *registers) {
    for (uint32_t i = 0; i < CORE_REGISTERS; i++) {
        rt_set_reg(m, core_registers[i], registers->core[i]);
    }
    for (uint32_t i = 0; i < FLOATS; i++) {
        rt_set_reg(m, RT_REG_S0 + (int)i, registers->floats[i]);
    }
    rt_set_reg(m, RT_REG_PC, registers->pc | 1u);
}

rt1062_snapshot_t *rt1062_snapshot(rt1062_t *m) {
    rt1062_snapshot_t *snapshot = malloc(sizeof *snapshot + m->circuit.state_size);
    if (snapshot == NULL) {
        return NULL;
    }
    save_registers(m, &snapshot->registers);
    snapshot->state = m->s;
    if (m->wired) {
        m->circuit.save(m->circuit.context, snapshot->circuit);
    }
    memcpy(snapshot->itcm, m->itcm, RT_ITCM_SIZE);
    memcpy(snapshot->dtcm, m->dtcm, RT_DTCM_SIZE);
    memcpy(snapshot->ocram, m->ocram, RT_OCRAM_SIZE);
    memcpy(snapshot->flash, m->flash, RT_FLASH_SIZE);
    return snapshot;
}

/* Page by page: what differs may be code. */
static void restore_code(rt1062_t *m, uint32_t base, const uint8_t *saved, uint32_t size) {
    enum { PAGE = 4096 };
    uint8_t *memory = rt_memory(m, base, size);
    for (uint32_t at = 0; at < size; at += PAGE) {
        if (memcmp(memory + at, saved + at, PAGE) != 0) {
            memcpy(memory + at, saved + at, PAGE);
            rt_code_changed(m, base + at, PAGE);
        }
    }
}

void rt1062_restore(rt1062_t *m, const rt1062_snapshot_t *snapshot) {
    m->s = snapshot->state;
    if (m->wired) {
        m->circuit.restore(m->circuit.context, snapshot->circuit);
    }
    restore_code(m, RT_ITCM_BASE, snapshot->itcm, RT_ITCM_SIZE);
    memcpy(m->dtcm, snapshot->dtcm, RT_DTCM_SIZE);
    memcpy(m->ocram, snapshot->ocram, RT_OCRAM_SIZE);
    restore_code(m, RT_FLASH_BASE, snapshot->flash, RT_FLASH_SIZE);
    load_registers(m, &snapshot->registers);
    m->interrupt = RT_NO_INTERRUPT;
    m->stopping = false;
    m->part_block = 0;
    m->output[RT1062_USB].count = 0;
    m->output[RT1062_UART].count = 0;
    m->i2c_trace.count = 0;
    rt_protection_changed(m);
}

void rt1062_snapshot_free(rt1062_snapshot_t *snapshot) {
    free(snapshot);
}

/* ------------------------------------------------------------------ calls */

/* Where a called function returns to: the end of flash memory, which is never executed. */
#define RETURN_ADDRESS (RT_FLASH_BASE + RT_FLASH_SIZE - 16)

/* No handler runs, and no critical section of the program's. @return false: that is not so in time. */
static bool reach_background(rt1062_t *m, uint64_t until_ns) {
    enum { STEP_ns = 1000 };
    while ((m->s.ipsr != 0 || rt_masks(m) != 0) && m->s.now_ns < until_ns) {
        if (rt1062_run(m, m->s.now_ns + STEP_ns) != RT1062_STOP_TIME) {
            return false;
        }
    }
    return m->s.ipsr == 0 && rt_masks(m) == 0;
}

rt1062_stop_t rt1062_call(rt1062_t *m, uint32_t function, const uint32_t arguments[4], uint64_t limit_ns,
                          uint32_t *result) {
    const uint64_t until_ns = m->s.now_ns + limit_ns;
    if (!reach_background(m, until_ns)) {
        return m->stopping ? m->stop : RT1062_STOP_REFUSED;
    }
    if (m->break_count == RT_BREAKS) {
        snprintf(m->why, sizeof m->why, "a call needs a break point of its own, and all %d are in use", RT_BREAKS);
        return RT1062_STOP_REFUSED;
    }
    registers_t before;
    save_registers(m, &before);
    const bool past_break = m->s.past_break;
    const uint32_t broken_at = m->s.broken_at;
    for (int i = 0; i < 4; i++) {
        rt_set_reg(m, RT_REG_R0 + i, arguments[i]);
    }
    rt_set_reg(m, RT_REG_SP, (before.core[13] & ~7u) - 8);
    rt_set_reg(m, RT_REG_LR, RETURN_ADDRESS | 1u);
    rt_set_reg(m, RT_REG_XPSR, XPSR_T); /* the background may be within an IT block */
    rt_set_reg(m, RT_REG_PC, function | 1u);
    m->s.sleeping = false;
    rt1062_break(m, RETURN_ADDRESS);
    const rt1062_stop_t stop = rt1062_run(m, until_ns);
    const bool returned = stop == RT1062_STOP_BREAK && rt_reg(m, RT_REG_PC) == RETURN_ADDRESS;
    m->break_count--;
    if (!returned) {
        return stop == RT1062_STOP_TIME ? RT1062_STOP_REFUSED : stop;
    }
    *result = rt_reg(m, RT_REG_R0);
    load_registers(m, &before);
    m->s.past_break = past_break;
    m->s.broken_at = broken_at;
    return RT1062_STOP_TIME;
}
