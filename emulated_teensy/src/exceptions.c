/* SPDX-License-Identifier: MIT */
/* Which exception is taken when, and what that does to registers and stack [V7M B1.5]. */
#include <string.h>

#include "machine.h"

enum {
    FRAME = 8 * 4,             /* R0-R3, R12, LR, return address, xPSR */
    FP_FRAME = 8 * 4 + 18 * 4, /* and S0-S15, FPSCR, one reserved word */
    CONTROL_FPCA = 4,
    XPSR_ALIGNED = 1 << 9,
    NOT_MASKED = 256,
    STORM = 200 /* the same interrupt so often in a row, without an instruction of anything else */
};

#define EXC_RETURN_HANDLER 0xFFFFFFF1u
#define EXC_RETURN_THREAD 0xFFFFFFF9u
#define EXC_RETURN_NO_FP (1u << 4)
#define XPSR_EXCEPTION 0x1FFu

/* ------------------------------------------------------------------ priorities */

/* -3 reset .. -1 HardFault, then 0..255: lower is more urgent. */
static int32_t priority_of(const rt1062_t *m, uint32_t exception) {
    return exception == RT_NMI ? -2 : exception == RT_HARD_FAULT ? -1 : m->s.scs.priority[exception];
}

/* The part of a priority that decides who interrupts whom. */
static int32_t group_of(const rt1062_t *m, int32_t priority) {
    return priority < 0 ? priority : priority & ~((2 << m->s.scs.aircr_group) - 1) & 0xFF;
}

static int32_t active_priority(const rt1062_t *m) {
    int32_t best = NOT_MASKED;
    for (uint32_t i = RT_NMI; i < RT_EXCEPTIONS; i++) {
        if (m->s.scs.active[i]) {
            const int32_t priority = group_of(m, priority_of(m, i));
            best = priority < best ? priority : best;
        }
    }
    return best;
}

/* What an exception must beat, masks included; PRIMASK if wanted. */
static int32_t masked_priority(rt1062_t *m, bool with_primask) {
    int32_t best = active_priority(m);
    const uint32_t base = rt_reg(m, RT_REG_BASEPRI) & 0xFF;
    if (base != 0) {
        const int32_t masked = group_of(m, (int32_t)base);
        best = masked < best ? masked : best;
    }
    if (with_primask && (rt_reg(m, RT_REG_PRIMASK) & 1) != 0 && best > 0) {
        best = 0;
    }
    if ((rt_reg(m, RT_REG_FAULTMASK) & 1) != 0 && best > -1) {
        best = -1;
    }
    return best;
}

static int32_t execution_priority(rt1062_t *m) {
    return masked_priority(m, true);
}

uint32_t rt_masks(rt1062_t *m) {
    return rt_reg(m, RT_REG_PRIMASK) << 16 | rt_reg(m, RT_REG_FAULTMASK) << 8 | (rt_reg(m, RT_REG_BASEPRI) & 0xFF);
}

uint32_t rt_exception_next(const rt1062_t *m) {
    uint32_t first = 0;
    for (uint32_t i = RT_NMI; i < RT_EXCEPTIONS; i++) {
        if (m->s.scs.pending[i] && m->s.scs.enabled[i] && (first == 0 || priority_of(m, i) < priority_of(m, first))) {
            first = i;
        }
    }
    return first;
}

bool rt_exceptions_wake(rt1062_t *m) {
    const uint32_t first = rt_exception_next(m);
    return first != 0 && group_of(m, priority_of(m, first)) < masked_priority(m, false);
}

void rt_irq_set(rt1062_t *m, uint32_t irq, bool high) {
    rt_scs_t *scs = &m->s.scs;
    if (scs->line[irq] == high) {
        return;
    }
    scs->line[irq] = high;
    if (high) {
        rt_exception_pend(m, RT_IRQ0 + irq);
    }
}

void rt_exception_pend(rt1062_t *m, uint32_t exception) {
    m->s.scs.pending[exception] = true;
    m->s.sleeping = false;
    rt_look_up(m);
}

void rt_lines_repend(rt1062_t *m) {
    for (uint32_t irq = 0; irq < RT_IRQS; irq++) {
        m->s.scs.pending[RT_IRQ0 + irq] |= m->s.scs.line[irq] && !m->s.scs.active[RT_IRQ0 + irq];
    }
}

/* ------------------------------------------------------------------ entry */

static bool store_word(rt1062_t *m, uint32_t address, uint32_t value) {
    uint8_t *memory = rt_memory(m, address, 4);
    if (memory == NULL || !rt_may_write(m, address)) {
        return false;
    }
    memcpy(memory, &value, 4);
    return true;
}

static uint32_t load_word(rt1062_t *m, uint32_t address) {
    uint32_t value = 0;
    const uint8_t *memory = rt_memory(m, address, 4);
    if (memory == NULL) {
        rt_refuse(m, "0x%08X holds no stack frame or vector", (unsigned)address);
    } else {
        memcpy(&value, memory, 4);
    }
    return value;
}

/* @return false: the stack can't take the frame. */
static bool push_frame(rt1062_t *m, uint32_t return_address, bool with_fp) {
    const uint32_t stack = rt_reg(m, RT_REG_SP);
    const uint32_t frame = (stack - (with_fp ? FP_FRAME : FRAME)) & ~7u;
    const uint32_t xpsr = (rt_reg(m, RT_REG_XPSR) & ~XPSR_EXCEPTION) | XPSR_T | m->s.ipsr;
    const uint32_t words[8] = {rt_reg(m, RT_REG_R0),
                               rt_reg(m, RT_REG_R0 + 1),
                               rt_reg(m, RT_REG_R0 + 2),
                               rt_reg(m, RT_REG_R0 + 3),
                               rt_reg(m, RT_REG_R0 + 12),
                               rt_reg(m, RT_REG_LR),
                               return_address,
                               (xpsr & ~(uint32_t)XPSR_ALIGNED) | ((stack & 4) != 0 ? XPSR_ALIGNED : 0)};
    bool stored = true;
    for (uint32_t i = 0; i < 8; i++) {
        stored = stored && store_word(m, frame + 4 * i, words[i]);
    }
    for (uint32_t i = 0; with_fp && i < 16; i++) {
        stored = stored && store_word(m, frame + FRAME + 4 * i, rt_reg(m, RT_REG_S0 + (int)i));
    }
    if (with_fp) {
        stored = stored && store_word(m, frame + FRAME + 64, rt_reg(m, RT_REG_FPSCR));
    }
    rt_set_reg(m, RT_REG_SP, frame);
    return stored;
}

/* The stack shares its memory with the variables below. The program's guard between them is small: large arrays reach
 * over it. */
static void watch_stack(rt1062_t *m) {
    if (m->stack_end == 0) {
        return;
    }
    const uint32_t stack = rt_reg(m, RT_REG_SP);
    const uint32_t left = stack > m->stack_end ? stack - m->stack_end : 0;
    m->stack_left = left < m->stack_left ? left : m->stack_left;
    if (left == 0) {
        rt_finding(m, RT1062_FINDING_STACK, "the stack reaches %u bytes below its end at 0x%08X, over the variables",
                   (unsigned)(m->stack_end - stack), (unsigned)m->stack_end);
    }
}

static void watch_for_storm(rt1062_t *m, uint32_t exception) {
    rt_scs_t *scs = &m->s.scs;
    const bool again = scs->storm_exception == exception && scs->storm_instructions == m->s.instructions;
    scs->storm_count = again ? scs->storm_count + 1 : 0;
    scs->storm_exception = exception;
    if (scs->storm_count == STORM) {
        rt_finding(m, RT1062_FINDING_STORM, "interrupt %d came %d times in a row: its cause is never taken away",
                   (int)exception - RT_IRQ0, STORM);
    }
}

static void enter(rt1062_t *m, uint32_t exception, uint32_t return_address) {
    rt_scs_t *scs = &m->s.scs;
    const uint32_t control = rt_reg(m, RT_REG_CONTROL);
    if ((control & 2) != 0) {
        rt_refuse(m, "the process stack is not modelled");
        return;
    }
    m->access_pc = return_address;
    watch_for_storm(m, exception);
    const bool with_fp = (control & CONTROL_FPCA) != 0;
    if (!push_frame(m, return_address, with_fp)) {
        rt_finding(m, RT1062_FINDING_FAULT, "no room for an exception's frame: the stack has overflowed");
        m->s.locked_up = true;
        return;
    }
    watch_stack(m);
    const uint32_t back = m->s.ipsr != 0 ? EXC_RETURN_HANDLER : EXC_RETURN_THREAD;
    rt_set_reg(m, RT_REG_LR, with_fp ? back & ~EXC_RETURN_NO_FP : back);
    rt_set_reg(m, RT_REG_CONTROL, control & ~(uint32_t)CONTROL_FPCA);
    rt_set_reg(m, RT_REG_XPSR, XPSR_T);
    rt_set_reg(m, RT_REG_IPSR, exception);
    m->s.ipsr = exception;
    scs->pending[exception] = false;
    scs->active[exception] = true;
    rt_set_reg(m, RT_REG_PC, load_word(m, scs->vtor + 4 * exception));
}

/* A fault exception that is off, or can't interrupt what runs, becomes a HardFault; within that one the processor locks
 * up. */
static void take_fault(rt1062_t *m) {
    uint32_t exception = m->s.fault_exception;
    m->s.fault_exception = 0;
    const bool on = exception == RT_HARD_FAULT || (m->s.scs.shcsr >> (16 + exception - RT_MEM_FAULT) & 1) != 0;
    const int32_t running = execution_priority(m);
    if (!on || group_of(m, priority_of(m, exception)) >= running) {
        exception = RT_HARD_FAULT;
        m->s.scs.hfsr |= 1u << 30; /* FORCED */
    }
    if (priority_of(m, exception) >= running) {
        m->s.locked_up = true;
        return;
    }
    enter(m, exception, m->s.fault_pc);
}

void rt_exceptions_take(rt1062_t *m) {
    if (m->s.fault_exception != 0) {
        take_fault(m);
        return;
    }
    m->masked_pending = false;
    const uint32_t first = rt_exception_next(m);
    if (first == 0) {
        return;
    }
    const int32_t priority = group_of(m, priority_of(m, first));
    if (priority < execution_priority(m)) {
        enter(m, first, rt_reg(m, RT_REG_PC));
    } else if (priority < active_priority(m)) {
        m->masked_pending = true; /* by the mask registers alone, which the program may write at any time */
        m->masks = rt_masks(m);
    }
}

/* ------------------------------------------------------------------ return */

static void pop_frame(rt1062_t *m, bool with_fp) {
    const uint32_t frame = rt_reg(m, RT_REG_SP);
    static const int registers[6] = {RT_REG_R0, RT_REG_R0 + 1, RT_REG_R0 + 2, RT_REG_R0 + 3, RT_REG_R0 + 12, RT_REG_LR};
    for (uint32_t i = 0; i < 6; i++) {
        rt_set_reg(m, registers[i], load_word(m, frame + 4 * i));
    }
    for (uint32_t i = 0; with_fp && i < 16; i++) {
        rt_set_reg(m, RT_REG_S0 + (int)i, load_word(m, frame + FRAME + 4 * i));
    }
    if (with_fp) {
        rt_set_reg(m, RT_REG_FPSCR, load_word(m, frame + FRAME + 64));
    }
    const uint32_t return_address = load_word(m, frame + 24);
    const uint32_t xpsr = load_word(m, frame + 28);
    const uint32_t control = rt_reg(m, RT_REG_CONTROL) & ~(uint32_t)CONTROL_FPCA;
    rt_set_reg(m, RT_REG_CONTROL, with_fp ? control | CONTROL_FPCA : control);
    rt_set_reg(m, RT_REG_SP, frame + (with_fp ? FP_FRAME : FRAME) + ((xpsr & XPSR_ALIGNED) != 0 ? 4 : 0));
    m->s.ipsr = xpsr & XPSR_EXCEPTION;
    rt_set_reg(m, RT_REG_IPSR, m->s.ipsr);
    rt_set_reg(m, RT_REG_XPSR, (xpsr & ~(XPSR_EXCEPTION | (uint32_t)XPSR_ALIGNED)) | XPSR_T);
    rt_set_reg(m, RT_REG_PC, return_address);
}

void rt_exception_return(rt1062_t *m, uint32_t exc_return) {
    rt_scs_t *scs = &m->s.scs;
    const uint32_t exception = m->s.ipsr;
    const bool plain =
        (exc_return | EXC_RETURN_NO_FP) == EXC_RETURN_HANDLER || (exc_return | EXC_RETURN_NO_FP) == EXC_RETURN_THREAD;
    if (!plain || exception == 0 || !scs->active[exception]) {
        rt_refuse(m, "return from exception %u by 0x%08X is not modelled", (unsigned)exception, (unsigned)exc_return);
        return;
    }
    scs->active[exception] = false;
    if (exception != RT_NMI) {
        rt_set_reg(m, RT_REG_FAULTMASK, 0);
    }
    scs->storm_instructions = m->s.instructions;
    pop_frame(m, (exc_return & EXC_RETURN_NO_FP) == 0);
    if (exception >= RT_IRQ0 && scs->line[exception - RT_IRQ0]) {
        scs->pending[exception] = true;
    }
}

/* ------------------------------------------------------------------ status registers [V7M B3.2.15] */

void rt_fault_status(rt1062_t *m, uint32_t exception, uint32_t address) {
    rt_scs_t *scs = &m->s.scs;
    switch (exception) {
    case RT_MEM_FAULT:
        scs->cfsr |= 1u << 1 | 1u << 7; /* DACCVIOL, MMARVALID */
        scs->mmfar = address;
        break;
    case RT_BUS_FAULT:
        scs->cfsr |= 1u << 9 | 1u << 15; /* PRECISERR, BFARVALID */
        scs->bfar = address;
        break;
    default:
        scs->cfsr |= address != 0 ? 1u << 24 : 1u << 16; /* UNALIGNED, UNDEFINSTR */
        break;
    }
}
