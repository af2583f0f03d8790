/* SPDX-License-Identifier: MIT */
/* System control space [V7M B3.2]: registers. The rules of exceptions are in exceptions.c, those of memory in
 * protection.c. */
#include "devices.h"
#include "handlers.h"

enum {
    SYST_CSR = 0x010,
    SYST_RVR = 0x014,
    SYST_CVR = 0x018,
    SYST_CALIB = 0x01C,
    NVIC_ISER = 0x100,
    NVIC_ICER = 0x180,
    NVIC_ISPR = 0x200,
    NVIC_ICPR = 0x280,
    NVIC_IABR = 0x300,
    NVIC_IPR = 0x400,
    CPUID = 0xD00,
    ICSR = 0xD04,
    VTOR = 0xD08,
    AIRCR = 0xD0C,
    SCR = 0xD10,
    CCR = 0xD14,
    SHPR1 = 0xD18,
    SHPR3 = 0xD20,
    SHCSR = 0xD24,
    CFSR = 0xD28,
    HFSR = 0xD2C,
    DFSR = 0xD30,
    MMFAR = 0xD34,
    BFAR = 0xD38,
    AFSR = 0xD3C,
    CLIDR = 0xD78,
    CTR = 0xD7C,
    CCSIDR = 0xD80,
    CSSELR = 0xD84,
    CPACR = 0xD88,
    MPU_TYPE = 0xD90,
    MPU_CTRL = 0xD94,
    MPU_RNR = 0xD98,
    MPU_RBAR = 0xD9C,
    MPU_RASR = 0xDA0,
    DEMCR = 0xDFC,
    FPCCR = 0xF34,
    FPCAR = 0xF38,
    FPDSCR = 0xF3C,
    ICIALLU = 0xF50,
    CACHE_LAST = 0xF78
};

enum {
    SYSTICK_ENABLE = 1,
    SYSTICK_INTERRUPT = 2,
    SYSTICK_PROCESSOR_CLOCK = 4,
    SYSTICK_FLAG = 1 << 16,
    /* On this chip the "external" clock of SysTick is 24 MHz / 240 [core] startup.c, configure_systick(). */
    SYSTICK_EXTERNAL_ns = 10000,
    SMALLEST_DIVIDED = 14, /* RASR.SIZE of 32 KB: eighths of a page */
    PRIORITY_BITS = 0xF0   /* [RM] four bits of priority */
};

#define AIRCR_KEY 0x05FA0000u
#define AIRCR_RESET (1u << 2)
#define AIRCR_READ 0xFA050000u
#define CPUID_VALUE 0x411FC271u /* Cortex-M7 r1p1 */

/* ------------------------------------------------------------------ SysTick */

static uint64_t systick_period_ns(const rt1062_t *m) {
    return ((uint64_t)m->s.scs.systick_reload + 1) * SYSTICK_EXTERNAL_ns;
}

static void systick_start(rt1062_t *m) {
    rt_scs_t *scs = &m->s.scs;
    scs->systick_begin_ns = rt_now(m);
    const bool on = (scs->systick_ctrl & SYSTICK_ENABLE) != 0 && scs->systick_reload != 0;
    rt_schedule(m, RT_EVENT_SYSTICK, on ? scs->systick_begin_ns + systick_period_ns(m) : RT_NEVER);
}

void rt_systick_event(rt1062_t *m) {
    rt_scs_t *scs = &m->s.scs;
    scs->systick_begin_ns += systick_period_ns(m);
    scs->systick_ctrl |= SYSTICK_FLAG;
    if ((scs->systick_ctrl & SYSTICK_INTERRUPT) != 0) {
        rt_exception_pend(m, RT_SYSTICK);
    }
    rt_schedule(m, RT_EVENT_SYSTICK, scs->systick_begin_ns + systick_period_ns(m));
}

static uint32_t systick_value(const rt1062_t *m) {
    const rt_scs_t *scs = &m->s.scs;
    if ((scs->systick_ctrl & SYSTICK_ENABLE) == 0) {
        return 0;
    }
    const uint64_t gone = (rt_now(m) - scs->systick_begin_ns) / SYSTICK_EXTERNAL_ns;
    return gone > scs->systick_reload ? 0 : (uint32_t)(scs->systick_reload - gone);
}

static bool systick_write(rt1062_t *m, uint32_t offset, uint32_t value) {
    rt_scs_t *scs = &m->s.scs;
    switch (offset) {
    case SYST_CSR:
        if ((value & SYSTICK_PROCESSOR_CLOCK) != 0) {
            return false; /* the image never counts its own clock */
        }
        scs->systick_ctrl = (scs->systick_ctrl & SYSTICK_FLAG) | (value & (SYSTICK_ENABLE | SYSTICK_INTERRUPT));
        systick_start(m);
        return true;
    case SYST_RVR:
        scs->systick_reload = value & 0xFFFFFF;
        return true;
    case SYST_CVR:
        scs->systick_ctrl &= ~(uint32_t)SYSTICK_FLAG;
        systick_start(m);
        return true;
    default:
        return false;
    }
}

/* ------------------------------------------------------------------ interrupt controller */

/* One of the registers with a bit per interrupt: which exceptions it is about. @return false: beyond the last one. */
static bool bit_register(uint32_t offset, uint32_t base, uint32_t *first) {
    *first = 16 + (offset - base) * 8;
    return offset >= base && offset < base + RT_IRQS / 8;
}

static uint32_t gather(const bool *flags, uint32_t first) {
    uint32_t value = 0;
    for (uint32_t i = 0; i < 32; i++) {
        value |= flags[first + i] ? 1u << i : 0;
    }
    return value;
}

static void scatter(bool *flags, uint32_t first, uint32_t bits, bool value) {
    for (uint32_t i = 0; i < 32; i++) {
        if ((bits >> i & 1) != 0) {
            flags[first + i] = value;
        }
    }
}

static bool nvic_read(rt1062_t *m, uint32_t offset, uint32_t *value) {
    uint32_t first = 0;
    if (bit_register(offset, NVIC_ISER, &first) || bit_register(offset, NVIC_ICER, &first)) {
        *value = gather(m->s.scs.enabled, first);
    } else if (bit_register(offset, NVIC_ISPR, &first) || bit_register(offset, NVIC_ICPR, &first)) {
        *value = gather(m->s.scs.pending, first);
    } else if (bit_register(offset, NVIC_IABR, &first)) {
        *value = gather(m->s.scs.active, first);
    } else {
        return false;
    }
    return true;
}

static bool nvic_write(rt1062_t *m, uint32_t offset, uint32_t value) {
    rt_scs_t *scs = &m->s.scs;
    uint32_t first = 0;
    if (bit_register(offset, NVIC_ISER, &first)) {
        scatter(scs->enabled, first, value, true);
    } else if (bit_register(offset, NVIC_ICER, &first)) {
        scatter(scs->enabled, first, value, false);
    } else if (bit_register(offset, NVIC_ISPR, &first)) {
        scatter(scs->pending, first, value, true);
    } else if (bit_register(offset, NVIC_ICPR, &first)) {
        scatter(scs->pending, first, value, false);
        rt_lines_repend(m);
    } else {
        return false;
    }
    rt_look_up(m);
    return true;
}

/* Priority registers can be accessed by byte, halfword and word. */
static bool priority_access(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value, bool write) {
    uint32_t first;
    if (offset >= NVIC_IPR && offset + size <= NVIC_IPR + RT_IRQS) {
        first = 16 + offset - NVIC_IPR;
    } else if (offset >= SHPR1 && offset + size <= SHPR3 + 4) {
        first = 4 + offset - SHPR1;
    } else {
        return false;
    }
    uint32_t read = 0;
    for (uint32_t i = 0; i < size; i++) {
        if (write) {
            m->s.scs.priority[first + i] = (uint8_t)(*value >> (8 * i) & PRIORITY_BITS);
        }
        read |= (uint32_t)m->s.scs.priority[first + i] << (8 * i);
    }
    if (!write) {
        *value = read;
    }
    rt_look_up(m);
    return true;
}

/* ------------------------------------------------------------------ system control block */

static uint32_t icsr(const rt1062_t *m) {
    const rt_scs_t *scs = &m->s.scs;
    uint32_t value = m->s.ipsr & 0x1FF;
    value |= scs->pending[RT_SYSTICK] ? 1u << 26 : 0;
    value |= scs->pending[RT_PENDSV] ? 1u << 28 : 0;
    value |= rt_exception_next(m) << 12; /* VECTPENDING */
    for (uint32_t i = RT_IRQ0; i < RT_EXCEPTIONS; i++) {
        value |= scs->pending[i] ? 1u << 22 : 0; /* ISRPENDING */
    }
    return value;
}

static void icsr_write(rt1062_t *m, uint32_t value) {
    rt_scs_t *scs = &m->s.scs;
    if ((value & 1u << 25) != 0) {
        scs->pending[RT_SYSTICK] = false;
    }
    if ((value & 1u << 27) != 0) {
        scs->pending[RT_PENDSV] = false;
    }
    static const struct {
        uint32_t bit;
        uint32_t exception;
    } set[] = {{26, RT_SYSTICK}, {28, RT_PENDSV}, {31, RT_NMI}};
    for (uint32_t i = 0; i < sizeof set / sizeof set[0]; i++) {
        if ((value >> set[i].bit & 1) != 0) {
            rt_exception_pend(m, set[i].exception);
        }
    }
}

static uint32_t cache_size(const rt1062_t *m) {
    /* 32 KB each: data 4 ways of 256 sets, instructions 2 ways of 512 sets, lines of 32 bytes. */
    return (m->s.scs.csselr & 1) != 0 ? 0xF01FE009u & 0x0FFFFFFFu : 0xF00FE019u & 0x0FFFFFFFu;
}

static bool scb_read(rt1062_t *m, uint32_t offset, uint32_t *value) {
    const rt_scs_t *scs = &m->s.scs;
    const struct {
        uint32_t offset;
        uint32_t value;
    } table[] = {
        {SYST_CSR, scs->systick_ctrl},
        {SYST_RVR, scs->systick_reload},
        {SYST_CVR, systick_value(m)},
        {SYST_CALIB, 0x800003E8u},
        {CPUID, CPUID_VALUE},
        {ICSR, icsr(m)},
        {VTOR, scs->vtor},
        {AIRCR, AIRCR_READ | scs->aircr_group << 8},
        {SCR, scs->scr},
        {CCR, scs->ccr},
        {SHCSR, scs->shcsr},
        {CFSR, scs->cfsr},
        {HFSR, scs->hfsr},
        {DFSR, 0},
        {MMFAR, scs->mmfar},
        {BFAR, scs->bfar},
        {AFSR, 0},
        {CLIDR, 0x09000003u},
        {CTR, 0x8303C003u},
        {CCSIDR, cache_size(m)},
        {CSSELR, scs->csselr},
        {CPACR, scs->cpacr},
        {MPU_TYPE, RT_MPU_REGIONS << 8},
        {MPU_CTRL, scs->mpu_ctrl},
        {MPU_RNR, scs->mpu_number},
        {MPU_RBAR, scs->mpu[scs->mpu_number].base | scs->mpu_number},
        {MPU_RASR, scs->mpu[scs->mpu_number].attributes},
        {DEMCR, scs->demcr},
        {FPCCR, scs->fpccr},
        {FPCAR, 0},
        {FPDSCR, 0},
    };
    for (uint32_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        if (table[i].offset == offset) {
            *value = table[i].value;
            return true;
        }
    }
    return false;
}

static bool aircr_write(rt1062_t *m, uint32_t value) {
    if ((value & 0xFFFF0000u) != AIRCR_KEY) {
        return true; /* [V7M B3.2.6] ignored without the key */
    }
    m->s.scs.aircr_group = value >> 8 & 7;
    if ((value & AIRCR_RESET) != 0) {
        rt_reset_request(m, RT_RESET_LOCKUP);
    }
    return true;
}

static bool mpu_write(rt1062_t *m, uint32_t offset, uint32_t value) {
    rt_scs_t *scs = &m->s.scs;
    switch (offset) {
    case MPU_CTRL:
        scs->mpu_ctrl = value & 7;
        break;
    case MPU_RNR:
        scs->mpu_number = value % RT_MPU_REGIONS;
        return true;
    case MPU_RBAR:
        if ((value & 1u << 4) != 0) {
            scs->mpu_number = value & 0xF;
        }
        scs->mpu[scs->mpu_number].base = value & ~0x1Fu;
        break;
    default:
        scs->mpu[scs->mpu_number].attributes = value;
        if ((value & 1) != 0 && (value >> 8 & 0xFF) != 0 && (value >> 1 & 0x1F) < SMALLEST_DIVIDED) {
            rt_refuse(m, "MPU_RASR 0x%08X disables an eighth smaller than a page, which is not modelled",
                      (unsigned)value);
        }
        break;
    }
    if ((scs->mpu_ctrl & 1) != 0 || offset == MPU_CTRL) {
        rt_protection_changed(m);
    }
    return true;
}

static bool scb_write(rt1062_t *m, uint32_t offset, uint32_t value) {
    rt_scs_t *scs = &m->s.scs;
    switch (offset) {
    case ICSR:
        icsr_write(m, value);
        return true;
    case VTOR:
        scs->vtor = value & ~0x7Fu;
        return true;
    case AIRCR:
        return aircr_write(m, value);
    case SCR:
        scs->scr = value & 0x16;
        return true;
    case CCR:
        scs->ccr = (value & 0x70318u) | 0x200u; /* STKALIGN is fixed */
        return (value & 0x18) == 0;             /* UNALIGN_TRP, DIV_0_TRP: not modelled */
    case SHCSR:
        scs->shcsr = value & 0x70000u;
        return true;
    case CFSR:
        scs->cfsr &= ~value;
        return true;
    case HFSR:
        scs->hfsr &= ~value;
        return true;
    case MMFAR:
    case BFAR:
        return true;
    case CSSELR:
        scs->csselr = value & 0xF;
        return true;
    case CPACR:
        scs->cpacr = value & 0x00F00000u;
        return true;
    case DEMCR:
        scs->demcr = value & 0x010007F1u;
        return true;
    case FPCCR:
        scs->fpccr = value;
        return (value & 0xC0000000u) == 0xC0000000u; /* only the state after reset is modelled */
    case MPU_CTRL:
    case MPU_RNR:
    case MPU_RBAR:
    case MPU_RASR:
        return mpu_write(m, offset, value);
    default:
        /* Cache maintenance: there are no caches here. */
        return offset >= ICIALLU && offset <= CACHE_LAST;
    }
}

static bool scs_read(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    if (priority_access(m, offset, size, value, false)) {
        return true;
    }
    const bool there = size == 4 && (scb_read(m, offset, value) || nvic_read(m, offset, value));
    if (there && offset == SYST_CSR) {
        m->s.scs.systick_ctrl &= ~(uint32_t)SYSTICK_FLAG;
    }
    return there;
}

static bool scs_write(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    if (priority_access(m, offset, size, &value, true)) {
        return true;
    }
    return size == 4 &&
           (systick_write(m, offset, value) || nvic_write(m, offset, value) || scb_write(m, offset, value));
}

static void scs_reset(rt1062_t *m) {
    m->s.scs = (rt_scs_t){.ccr = 0x200, .fpccr = 0xC0000000u, .vtor = 0};
    for (uint32_t i = 0; i < RT_IRQ0; i++) {
        m->s.scs.enabled[i] = true;
    }
    rt_protection_changed(m);
}

const rt_device_t rt_scs = {"the system control space", 0xE000E000u, 0x1000, scs_read, scs_write, scs_reset};

/* ------------------------------------------------------------------ cycle counter [V7M C1.8] */

enum { DWT_CTRL = 0, DWT_CYCCNT = 4 };

static uint64_t cycles_now(const rt1062_t *m) {
    return rt_now(m) * RT_CPU_MHz / 1000;
}

static bool dwt_read(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    if (size != 4 || offset > DWT_CYCCNT) {
        return false;
    }
    const rt_scs_t *scs = &m->s.scs;
    const bool on = (scs->dwt_ctrl & 1) != 0;
    *value = offset == DWT_CTRL ? scs->dwt_ctrl
             : on               ? (uint32_t)(cycles_now(m) - scs->cyccnt_base)
                                : (uint32_t)scs->cyccnt_base;
    return true;
}

static bool dwt_write(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    rt_scs_t *scs = &m->s.scs;
    if (size != 4 || offset > DWT_CYCCNT) {
        return false;
    }
    const bool was_on = (scs->dwt_ctrl & 1) != 0;
    uint32_t count = 0;
    dwt_read(m, DWT_CYCCNT, 4, &count);
    if (offset == DWT_CYCCNT) {
        count = value;
    } else {
        scs->dwt_ctrl = value & 1;
    }
    const bool on = (scs->dwt_ctrl & 1) != 0;
    (void)was_on;
    scs->cyccnt_base = on ? cycles_now(m) - count : count;
    return true;
}

const rt_device_t rt_dwt = {"the cycle counter", 0xE0001000u, 0x1000, dwt_read, dwt_write, NULL};
