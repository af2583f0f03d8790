/* SPDX-License-Identifier: MIT */
/* Resets, and SRC (i.MX RT1060 RM, chapter SRC), which remembers them. */
#include "machine.h"

#include "rom.h"

enum { SCR = 0x00, SRSR = 0x08, GPR1 = 0x20, MASKED = 5 };

#define SCR_RESET 0xA0480520u
/* MASK_WDOG3_RST, WDOG3's reset not passed on if it is MASKED; MASK_WDOG_RST; LOCKUP_RST. Others are for debuggers. */
#define SCR_WRITABLE 0xF0000790u
/* Cleared by writing one; TEMPSENSE_RST_B by writing zero (CrashReport.cpp of the core, fsl_src.c of the vendor). */
#define SRSR_BY_ONE 0x000000FFu
#define SRSR_BY_ZERO 0x00000100u

/* ---- resets */

static bool masked(const rt1062_t *m, uint32_t flags) {
    return (flags == RT_RESET_WDOG3 && m->s.src.scr >> 28 == MASKED) ||
           (flags == RT_RESET_WDOG12 && (m->s.src.scr >> 7 & 0xF) == MASKED);
}

void rt_reset_request(rt1062_t *m, uint32_t flags) {
    if (!masked(m, flags)) {
        m->s.reset_wanted |= flags;
        rt_look_up(m);
    }
}

void rt1062_reset(rt1062_t *m, uint32_t flags) {
    rt_reset_request(m, flags);
}

/* The flash chip has no reset wire: what it is doing goes on. */
void rt_reset_now(rt1062_t *m, uint32_t flags) {
    m->s.reset_flags = flags;
    m->s.reset_wanted = 0;
    for (uint32_t i = 0; i < RT_EVENT_COUNT; i++) {
        m->s.deadline_ns[i] = i == RT_EVENT_FLASH ? m->s.deadline_ns[i] : RT_NEVER;
    }
    m->s.itcm_size = 128 * 1024; /* as the fuses of a new chip have it (chapter FlexRAM) */
    m->s.dtcm_size = 128 * 1024;
    rt_protection_changed(m);
    for (uint32_t i = 0; rt_devices[i] != NULL; i++) {
        if (rt_devices[i]->reset != NULL) {
            rt_devices[i]->reset(m);
        }
    }
    rt_rom_boot(m);
}

/* ---- SRC */

static bool src_read(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    const rt_src_t *src = &m->s.src;
    if (size != 4) {
        return false;
    }
    if (offset >= GPR1 && offset < GPR1 + 4 * RT_SRC_GPRS) {
        *value = src->gpr[(offset - GPR1) / 4];
    } else if (offset == SCR) {
        *value = src->scr;
    } else if (offset == SRSR) {
        *value = src->srsr;
    } else {
        return false;
    }
    return true;
}

static bool src_write(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    rt_src_t *src = &m->s.src;
    if (size != 4) {
        return false;
    }
    if (offset >= GPR1 && offset < GPR1 + 4 * RT_SRC_GPRS) {
        src->gpr[(offset - GPR1) / 4] = value;
    } else if (offset == SCR) {
        src->scr = (src->scr & ~SCR_WRITABLE) | (value & SCR_WRITABLE);
    } else if (offset == SRSR) {
        src->srsr &= ~(value & SRSR_BY_ONE) & ~(~value & SRSR_BY_ZERO);
    } else {
        return false;
    }
    return true;
}

static void src_reset(rt1062_t *m) {
    rt_src_t *src = &m->s.src;
    if ((m->s.reset_flags & RT_RESET_POWER) != 0) {
        *src = (rt_src_t){.srsr = RT_RESET_POWER};
    } else {
        src->srsr |= m->s.reset_flags;
    }
    src->scr = SCR_RESET;
}

const rt_device_t rt_src = {"SRC", 0x400F8000, 0x4000, src_read, src_write, src_reset};
