/* SPDX-License-Identifier: MIT */
/*
 * The processor: Unicorn's Cortex-M7 in slices. Unicorn knows instructions and memory. When to stop, which exception
 * comes next and what time it is, is decided here. That is at the beginning of a basic block or, with config.exact,
 * between any two instructions.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "machine.h"

#define NOWHERE 0xFFFFFFFEu /* Unicorn's end address: never reached */

enum { UNDEFINSTR = 1 << 16, INVSTATE = 1 << 17 }; /* of CFSR [V7M B3.2.15] */

enum {
    INTERRUPT_SVC = 2,
    INTERRUPT_ALIGNMENT = 4, /* LDREX, STREX */
    UNKNOWN_ADDRESS = 1,
    INTERRUPT_BREAKPOINT = 7,
    INTERRUPT_EXCEPTION_RETURN = 8,
    BKPT_UPLOAD = 251 /* [core] usb.c, _reboot_Teensyduino_() */
};

uint32_t rt_reg(rt1062_t *m, int number) {
    uint32_t value = 0;
    m->api.reg_read(m->engine, number, &value);
    return value;
}

void rt_set_reg(rt1062_t *m, int number, uint32_t value) {
    m->api.reg_write(m->engine, number, &value);
}

void rt_look_up(rt1062_t *m) {
    m->look_up = true;
}

void rt_stop(rt1062_t *m, rt1062_stop_t stop) {
    if (!m->stopping) {
        m->stopping = true;
        m->stop = stop;
    }
    rt_look_up(m);
}

void rt_leave_it_block(rt1062_t *m) {
    const uint32_t xpsr = rt_reg(m, RT_REG_XPSR);
    if ((xpsr & XPSR_IT) != 0) {
        rt_set_reg(m, RT_REG_XPSR, xpsr & ~XPSR_IT);
    }
}

/* ------------------------------------------------------------------ basic blocks */

static uint32_t halfword_at(rt1062_t *m, uint32_t address) {
    const uint8_t *memory = rt_memory(m, address, 2);
    return memory == NULL ? 0 : (uint32_t)memory[0] | (uint32_t)memory[1] << 8;
}

static uint32_t instruction_size(rt1062_t *m, uint32_t address) {
    return halfword_at(m, address) >> 11 >= 0x1D ? 4 : 2;
}

static uint32_t count_instructions(rt1062_t *m, uint32_t address, uint32_t size) {
    uint32_t count = 0;
    for (uint32_t at = address; at < address + size; at += instruction_size(m, at)) {
        count++;
    }
    return count;
}

static uint32_t instructions_of(rt1062_t *m, uint32_t address, uint32_t size) {
    rt_block_t *block = &m->blocks[(address >> 1) % RT_BLOCKS];
    if (block->address != address || block->size != size) {
        *block = (rt_block_t){address, (uint16_t)size, (uint16_t)count_instructions(m, address, size)};
    }
    return block->instructions;
}

void rt_code_changed(rt1062_t *m, uint32_t address, uint32_t size) {
    enum { LONGEST_BLOCK = 1024 };
    for (uint32_t i = 0; i < (LONGEST_BLOCK + size) / 2 && i < RT_BLOCKS; i++) {
        m->blocks[((address - LONGEST_BLOCK) / 2 + i) % RT_BLOCKS] = (rt_block_t){0};
    }
    m->api.control(m->engine, RT_UC_CTL_REMOVE_CACHE, (uint64_t)address, (uint64_t)address + size);
}

static bool at_break(rt1062_t *m, uint32_t address) {
    for (uint32_t i = 0; i < m->break_count; i++) {
        if (m->break_at[i] == address && !(m->s.past_break && m->s.broken_at == address)) {
            return true;
        }
    }
    return false;
}

static bool masks_changed(rt1062_t *m) {
    return m->masked_pending && rt_masks(m) != m->masks;
}

static void on_block(rt_uc_engine_t *engine, uint64_t address, uint32_t size, void *user) {
    rt1062_t *m = user;
    if (m->break_count > 0 && at_break(m, (uint32_t)address)) {
        m->s.broken_at = (uint32_t)address;
        m->s.past_break = true;
        rt_stop(m, RT1062_STOP_BREAK);
    }
    if (rt_nor_busy(m) && (uint32_t)address - RT_FLASH_BASE < RT_FLASH_SIZE) {
        m->access_pc = (uint32_t)address; /* translated before: Unicorn does not ask for the right to fetch it again */
        rt_nor_read_while_busy(m, (uint32_t)address, true);
    }
    if (m->budget_ns <= 0 || m->look_up || masks_changed(m)) {
        m->api.stop(engine);
        return;
    }
    const uint32_t instructions = instructions_of(m, (uint32_t)address, size);
    const int64_t cost_ns = (int64_t)instructions * m->config.instruction_ns;
    if (m->config.exact && cost_ns > m->budget_ns && !m->in_part) {
        m->part_block = (uint32_t)address;
        m->part_size = size;
        m->api.stop(engine);
        return;
    }
    m->s.past_break = false;
    m->block_at = (uint32_t)address;
    m->budget_ns -= (uint32_t)address == m->pace_at ? m->pace_ns : 0;
    m->budget_ns = m->budget_ns > 0 ? m->budget_ns : 0; /* no event is passed */
    m->budget_ns -= cost_ns;
    m->s.instructions += instructions;
}

/* Execute as many instructions of a block as there is time for: the block is translated anew, ending there, and
 * forgotten again. */
static void run_part(rt1062_t *m) {
    const uint32_t begin = m->part_block;
    uint32_t end = begin;
    int64_t left_ns = m->budget_ns;
    while (left_ns > 0 && end < begin + m->part_size) {
        end += instruction_size(m, end);
        left_ns -= m->config.instruction_ns;
    }
    m->part_block = 0;
    m->in_part = true;
    m->api.control(m->engine, RT_UC_CTL_REMOVE_CACHE, (uint64_t)begin, (uint64_t)begin + m->part_size);
    m->api.start(m->engine, begin | 1u, end, 0, 0);
    m->api.control(m->engine, RT_UC_CTL_REMOVE_CACHE, (uint64_t)begin, (uint64_t)begin + m->part_size);
    m->in_part = false;
}

/* ------------------------------------------------------------------ what Unicorn reports */

static void on_interrupt(rt_uc_engine_t *engine, uint32_t number, void *user) {
    rt1062_t *m = user;
    m->interrupt = number;
    m->api.stop(engine);
}

static bool on_undefined(rt_uc_engine_t *engine, void *user) {
    (void)engine;
    rt1062_t *m = user;
    const uint32_t pc = rt_reg(m, RT_REG_PC);
    m->access_pc = pc;
    const uint32_t instruction = halfword_at(m, pc) << 16 | halfword_at(m, pc + 2);
    if ((rt_reg(m, RT_REG_XPSR) & XPSR_T) == 0) {
        rt_fault(m, RT_USAGE_FAULT, 0, "branch to 0x%08X, which is even: no Thumb code, as behind a null pointer",
                 (unsigned)pc);
        m->s.scs.cfsr ^= UNDEFINSTR | INVSTATE;
    } else if (!rt_fpu_is_double(instruction)) {
        rt_fault(m, RT_USAGE_FAULT, 0, "undefined instruction 0x%08X", (unsigned)instruction);
    } else if (rt_fpu_double(m, instruction)) {
        return true;
    } else {
        rt_refuse(m, "double-precision instruction 0x%08X, or a mode of FPSCR for it, is not modelled",
                  (unsigned)instruction);
    }
    return false;
}

static bool on_invalid_memory(rt_uc_engine_t *engine, int type, uint64_t address, int size, int64_t value, void *user) {
    (void)engine;
    (void)value;
    rt1062_t *m = user;
    m->access_pc = rt_reg(m, RT_REG_PC);
    if ((uint32_t)address - RT_FLASH_BASE < RT_FLASH_SIZE && rt_nor_busy(m)) {
        rt_nor_read_while_busy(m, (uint32_t)address, type == RT_UC_MEM_FETCH || type == RT_UC_MEM_FETCH_PROT);
        return false;
    }
    const bool there = rt_memory(m, (uint32_t)address, 1) != NULL;
    static const char *const what[] = {"read", "write", "execution"};
    const int kind =
        (type - 16) %
        3; /* UC_MEM_READ 16, WRITE 17, FETCH 18; unmapped 19..21; then WRITE_PROT, READ_PROT, FETCH_PROT */
    const char *name = type < 22 ? what[kind] : type == 22 ? "write" : type == 23 ? "read" : "execution";
    rt_fault(m, there ? RT_MEM_FAULT : RT_BUS_FAULT, (uint32_t)address, "%s of %d bytes at 0x%08X, %s", name, size,
             (unsigned)address, there ? "which is forbidden there" : "where there is nothing");
    return false;
}

static void serve_interrupt(rt1062_t *m) {
    const uint32_t number = m->interrupt;
    const uint32_t pc = rt_reg(m, RT_REG_PC);
    m->interrupt = RT_NO_INTERRUPT;
    if (m->s.fault_exception != 0) {
        return; /* the block went on behind the instruction at fault, which is to be taken first */
    }
    m->access_pc = pc;
    if (number == INTERRUPT_EXCEPTION_RETURN) {
        rt_exception_return(m, pc | 1u);
    } else if (number == INTERRUPT_SVC) {
        rt_exception_pend(m, RT_SVCALL);
    } else if (number == INTERRUPT_BREAKPOINT && halfword_at(m, pc) == (0xBE00u | BKPT_UPLOAD)) {
        snprintf(m->why, sizeof m->why, "the program asked for the uploader");
        rt_stop(m, RT1062_STOP_UPLOAD);
    } else if (number == INTERRUPT_BREAKPOINT) {
        rt_fault(m, RT_HARD_FAULT, 0, "a bkpt instruction without a debugger");
    } else if (number == INTERRUPT_ALIGNMENT) {
        rt_fault(m, RT_USAGE_FAULT, UNKNOWN_ADDRESS, "unaligned exclusive access");
    } else if (!m->stopping) {
        rt_refuse(m, "Unicorn reports its interrupt %u at 0x%08X", (unsigned)number, (unsigned)pc);
    }
}

/* ------------------------------------------------------------------ running */

static bool is_wait(rt1062_t *m, uint32_t pc) {
    return halfword_at(m, pc) == 0xBF30; /* WFI */
}

static void after_slice(rt1062_t *m, int error) {
    if (m->interrupt != RT_NO_INTERRUPT) {
        serve_interrupt(m);
    } else if (error != RT_UC_ERR_OK && m->s.fault_exception == 0 && !m->stopping) {
        rt_refuse(m, "Unicorn: %s at 0x%08X", m->api.error_text(error), (unsigned)rt_reg(m, RT_REG_PC));
    } else if (is_wait(m, rt_reg(m, RT_REG_PC) - 2) && !m->look_up && m->budget_ns > 0 && !rt_exceptions_wake(m)) {
        m->s.sleeping = true;
    }
}

void rt_cpu_slice(rt1062_t *m, uint64_t until_ns) {
    m->slice_ns = (int64_t)(until_ns - m->s.now_ns);
    m->budget_ns = m->slice_ns;
    m->look_up_ns = until_ns;
    m->look_up = false;
    const int error = m->api.start(m->engine, rt_reg(m, RT_REG_PC) | 1u, NOWHERE, 0, 0);
    if (m->part_block != 0) {
        run_part(m);
    }
    after_slice(m, error);
    m->s.now_ns += (uint64_t)(m->slice_ns - m->budget_ns);
    m->slice_ns = 0;
    m->budget_ns = 0;
}

void rt_cpu_reset(rt1062_t *m, uint32_t stack, uint32_t entry) {
    for (int i = 0; i <= 12; i++) {
        rt_set_reg(m, RT_REG_R0 + i, 0);
    }
    for (int i = 0; i < 32; i++) {
        rt_set_reg(m, RT_REG_S0 + i, 0);
    }
    static const int zeroed[] = {RT_REG_FPSCR,   RT_REG_IPSR,      RT_REG_PRIMASK,
                                 RT_REG_BASEPRI, RT_REG_FAULTMASK, RT_REG_CONTROL};
    for (uint32_t i = 0; i < sizeof zeroed / sizeof zeroed[0]; i++) {
        rt_set_reg(m, zeroed[i], 0);
    }
    rt_set_reg(m, RT_REG_XPSR, 1u << 24);
    rt_set_reg(m, RT_REG_LR, 0xFFFFFFFFu);
    rt_set_reg(m, RT_REG_SP, stack);
    rt_set_reg(m, RT_REG_PC, entry | 1u);
    m->s.ipsr = 0;
    m->s.sleeping = false;
    m->s.locked_up = false;
    m->s.fault_exception = 0;
    m->interrupt = RT_NO_INTERRUPT;
}

/* ------------------------------------------------------------------ opening */

static bool map_memories(rt1062_t *m) {
    const struct {
        uint32_t base;
        uint32_t size;
        uint8_t **bytes;
    } memories[] = {{RT_ITCM_BASE, RT_ITCM_SIZE, &m->itcm},
                    {RT_DTCM_BASE, RT_DTCM_SIZE, &m->dtcm},
                    {RT_OCRAM_BASE, RT_OCRAM_SIZE, &m->ocram},
                    {RT_FLASH_BASE, RT_FLASH_SIZE, &m->flash}};
    for (uint32_t i = 0; i < sizeof memories / sizeof memories[0]; i++) {
        *memories[i].bytes = aligned_alloc(4096, memories[i].size);
        if (*memories[i].bytes == NULL || m->api.map_memory(m->engine, memories[i].base, memories[i].size,
                                                            RT_UC_PROT_ALL, *memories[i].bytes) != RT_UC_ERR_OK) {
            return false;
        }
        memset(*memories[i].bytes, 0xFF, memories[i].size);
    }
    return true;
}

static bool add_hook(rt1062_t *m, uint32_t number, int type, rt_callback_t callback) {
    return m->api.hook_add(m->engine, &m->hooks[RT_WINDOWS + number], type, callback, m, 1, 0) == RT_UC_ERR_OK;
}

bool rt_cpu_open(rt1062_t *m, char *why, size_t why_size) {
    const bool opened = m->api.open(RT_UC_ARCH_ARM, RT_UC_MODE_M, &m->engine) == RT_UC_ERR_OK &&
                        m->api.control(m->engine, RT_UC_CTL_CPU_MODEL, RT_UC_CPU_CORTEX_M7) == RT_UC_ERR_OK;
    const bool ready = opened && map_memories(m) && rt_bus_attach(m) &&
                       add_hook(m, 0, RT_UC_HOOK_BLOCK, (rt_callback_t)on_block) &&
                       add_hook(m, 1, RT_UC_HOOK_INTR, (rt_callback_t)on_interrupt) &&
                       add_hook(m, 2, RT_UC_HOOK_INSN_INVALID, (rt_callback_t)on_undefined) &&
                       add_hook(m, 3, RT_UC_HOOK_INVALID_MEMORY, (rt_callback_t)on_invalid_memory);
    if (!ready) {
        snprintf(why, why_size, "Unicorn would not make a Cortex-M7 with this chip's memory");
    }
    m->interrupt = RT_NO_INTERRUPT;
    return ready;
}

void rt_cpu_close(rt1062_t *m) {
    if (m->engine != NULL) {
        m->api.close(m->engine);
        m->engine = NULL;
    }
    free(m->itcm);
    free(m->dtcm);
    free(m->ocram);
    free(m->flash);
}
