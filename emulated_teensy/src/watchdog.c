/* SPDX-License-Identifier: MIT */
/*
 * WDOG3 (i.MX RT1060 RM, chapter RTWDOG; bits, reset values and the window of 128 bus clocks: the vendor's SVD file).
 * What that leaves open is as in the manual of the same block in NXP's MWCT101xS, chapter "Watchdog timer". There see
 * "Unlocking the watchdog", "Using interrupts to delay resets". Configuring anew does not set the counter back here:
 * neither says that it would.
 */
#include "watchdog.h"

#include "handlers.h"
#include "machine.h"

enum {
    CS = 0x0,
    CNT = 0x4,
    TOVAL = 0x8,
    WIN = 0xC,
    IRQ_RTWDOG = 93,
    LPO_Hz = 32768,
    WINDOW_clocks = 128, /* to reconfigure in after unlocking; from interrupt to reset */
    PAIR_clocks = 16,    /* between the halves of a 16-bit command */
    CROSSING_periods = 3 /* of the watchdog's own clock until RCS is set; the manual gives no figure */
};

#define REFRESH 0xB480A602u
#define UNLOCK 0xD928C520u

#define CS_TST (3u << 3)
#define CS_UPDATE (1u << 5)
#define CS_INT (1u << 6)
#define CS_EN (1u << 7)
#define CS_RCS (1u << 10)
#define CS_ULK (1u << 11)
#define CS_PRES (1u << 12)
#define CS_CMD32EN (1u << 13)
#define CS_FLG (1u << 14)
#define CS_WIN (1u << 15)
#define CS_RESET 0x2980u
#define CS_CONFIGURED                                                                                                  \
    (CS_UPDATE | CS_INT | CS_EN | CS_PRES | CS_CMD32EN | CS_WIN | 0x307u) /* CLK, DBG, WAIT and STOP besides */
enum { WROTE_CS = 1, WROTE_TOVAL = 2, WROTE_WIN = 4 };

/* ---- the counter */

static uint32_t clock_hz(const rt1062_t *m) {
    const uint32_t root = (m->s.watchdog.cs >> 8 & 3) == 1 ? (uint32_t)LPO_Hz : rt_clock_hz(m, RT_ROOT_IPG);
    return (m->s.watchdog.cs & CS_PRES) != 0 ? root / 256 : root;
}

static uint64_t count_now(const rt1062_t *m) {
    const rt_watchdog_t *w = &m->s.watchdog;
    if ((w->cs & CS_EN) == 0) {
        return w->count;
    }
    const uint64_t elapsed_ns = rt_now(m) - w->from_ns;
    const uint64_t hz = clock_hz(m);
    return w->count + elapsed_ns / 1000000000u * hz + elapsed_ns % 1000000000u * hz / 1000000000u;
}

static uint64_t clocks_ns(const rt1062_t *m, uint32_t bus_clocks) {
    const uint64_t hz = rt_clock_hz(m, RT_ROOT_IPG);
    return hz == 0 ? RT_NEVER / 2 : bus_clocks * 1000000000ull / hz;
}

static void schedule_bite(rt1062_t *m) {
    rt_watchdog_t *w = &m->s.watchdog;
    if (w->biting) {
        return;
    }
    const uint64_t hz = clock_hz(m);
    if ((w->cs & CS_EN) == 0 || hz == 0) {
        rt_schedule(m, RT_EVENT_WATCHDOG, RT_NEVER);
        return;
    }
    const uint64_t left = w->toval > w->count ? w->toval - w->count : 0;
    rt_schedule(m, RT_EVENT_WATCHDOG, w->from_ns + (left * 1000000000u + hz - 1) / hz);
}

static void set_count(rt1062_t *m, uint64_t count) {
    m->s.watchdog.count = count;
    m->s.watchdog.from_ns = rt_now(m);
    schedule_bite(m);
}

/* With INT the interrupt comes first and the reset follows, whatever the program does. */
static void bite(rt1062_t *m) {
    rt_watchdog_t *w = &m->s.watchdog;
    if (w->biting || (w->cs & CS_INT) == 0) {
        rt_reset_request(m, RT_RESET_WDOG3);
        return;
    }
    w->biting = true;
    w->cs |= CS_FLG;
    rt_irq_set(m, IRQ_RTWDOG, true);
    rt_schedule(m, RT_EVENT_WATCHDOG, rt_now(m) + clocks_ns(m, WINDOW_clocks));
}

void rt_watchdog_event(rt1062_t *m) {
    if (!m->s.watchdog.biting) {
        m->access_pc = rt_reg(m, RT_REG_PC);
        rt_finding(m, RT1062_FINDING_WATCHDOG, "WDOG3 was not refreshed in time: it bites");
    }
    bite(m);
}

/* ---- commands written to CNT */

static void refresh(rt1062_t *m) {
    rt_watchdog_t *w = &m->s.watchdog;
    if ((w->cs & CS_WIN) != 0 && count_now(m) < w->win) {
        rt_finding(m, RT1062_FINDING_WATCHDOG,
                   "WDOG3 is refreshed at count %u, before its window opens at %u: it bites", (unsigned)count_now(m),
                   (unsigned)w->win);
        bite(m);
        return;
    }
    set_count(m, 0);
}

static void unlock(rt1062_t *m) {
    rt_watchdog_t *w = &m->s.watchdog;
    if ((w->cs & CS_UPDATE) == 0) {
        rt_finding(m, RT1062_FINDING_WATCHDOG, "WDOG3 is unlocked although CS.UPDATE forbids changes: it bites");
        bite(m);
        return;
    }
    w->open = true;
    w->open_until_ns = rt_now(m) + clocks_ns(m, WINDOW_clocks);
    w->written = 0;
    w->cs &= ~CS_RCS;
}

static void bad_command(rt1062_t *m, uint32_t size, uint32_t value) {
    rt_finding(m, RT1062_FINDING_WATCHDOG, "WDOG3_CNT is written with 0x%X (%u bytes), no command of it: it bites",
               (unsigned)value, (unsigned)size);
    bite(m);
}

static void command(rt1062_t *m, uint32_t value) {
    if (value == REFRESH) {
        refresh(m);
    } else {
        unlock(m);
    }
}

static void halfword_command(rt1062_t *m, uint32_t value) {
    rt_watchdog_t *w = &m->s.watchdog;
    const uint32_t whole = value << 16 | w->half;
    const bool second = w->half != 0;
    const bool in_time = rt_now(m) - w->half_ns <= clocks_ns(m, PAIR_clocks);
    w->half = 0;
    if (!second && (value == (REFRESH & 0xFFFF) || value == (UNLOCK & 0xFFFF))) {
        w->half = value;
        w->half_ns = rt_now(m);
    } else if (second && in_time && (whole == REFRESH || whole == UNLOCK)) {
        command(m, whole);
    } else {
        bad_command(m, 2, value);
    }
}

static void count_written(rt1062_t *m, uint32_t size, uint32_t value) {
    const bool words = (m->s.watchdog.cs & CS_CMD32EN) != 0;
    if (words && size == 4 && (value == REFRESH || value == UNLOCK)) {
        command(m, value);
    } else if (!words && size == 2) {
        halfword_command(m, value);
    } else {
        bad_command(m, size, value);
    }
}

/* ---- configuration */

/* A window that has run out unused; what was written in it is lost. */
static void look_at_window(rt1062_t *m) {
    rt_watchdog_t *w = &m->s.watchdog;
    if (!w->open || rt_now(m) <= w->open_until_ns) {
        return;
    }
    w->open = false;
    if (w->written != 0) {
        rt_finding(m, RT1062_FINDING_WATCHDOG,
                   "WDOG3: not all of CS, TOVAL and WIN were written within %u bus clocks: nothing changes",
                   (unsigned)WINDOW_clocks);
    }
}

/* It takes effect when all registers but CNT were written; WIN needs not if there is no window. */
static void take_effect(rt1062_t *m) {
    rt_watchdog_t *w = &m->s.watchdog;
    const uint32_t wanted = WROTE_CS | WROTE_TOVAL | ((w->new_cs & CS_WIN) != 0 ? (uint32_t)WROTE_WIN : 0);
    if ((w->written & wanted) != wanted) {
        return;
    }
    const uint64_t count = count_now(m);
    const uint32_t flag = w->cs & CS_FLG & ~w->new_cs; /* cleared by writing one */
    w->cs = (w->new_cs & CS_CONFIGURED) | flag | CS_RCS;
    const uint64_t hz = clock_hz(m);
    w->done_ns = hz == 0 ? RT_NEVER : rt_now(m) + CROSSING_periods * 1000000000ull / hz;
    w->toval = w->new_toval;
    w->win = (w->written & WROTE_WIN) != 0 ? w->new_win : w->win;
    w->open = false;
    if (!w->biting) {
        rt_irq_set(m, IRQ_RTWDOG, flag != 0);
    }
    set_count(m, count);
}

static void configured(rt1062_t *m, uint32_t which, uint32_t *kept, uint32_t value, const char *name) {
    rt_watchdog_t *w = &m->s.watchdog;
    if (!w->open) {
        rt_finding(m, RT1062_FINDING_WATCHDOG, "%s is written while the watchdog is locked: nothing happens", name);
    } else if ((w->written & which) != 0) {
        rt_finding(m, RT1062_FINDING_WATCHDOG, "%s is written twice within one window: the first value counts", name);
    } else {
        *kept = value;
        w->written |= which;
        take_effect(m);
    }
}

static bool status_ok(rt1062_t *m, uint32_t value) {
    if ((value >> 8 & 3) > 1 || (value & CS_TST) != 0) {
        rt_refuse(m, "WDOG3_CS: 0x%X asks for a clock or a test mode that is not modelled", (unsigned)value);
        return false;
    }
    return true;
}

static bool clocked(rt1062_t *m) {
    return rt_clock_needed(m, RT_CLOCK_WDOG3, "WDOG3");
}

static bool watchdog_write(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    rt_watchdog_t *w = &m->s.watchdog;
    if (!clocked(m)) {
        return true;
    }
    look_at_window(m);
    if (offset == CNT) {
        count_written(m, size, value);
        return true;
    }
    if (size != 4) {
        return false;
    }
    if (offset == CS && status_ok(m, value)) {
        configured(m, WROTE_CS, &w->new_cs, value, "WDOG3_CS");
    } else if (offset == TOVAL) {
        configured(m, WROTE_TOVAL, &w->new_toval, value & 0xFFFF, "WDOG3_TOVAL");
    } else if (offset == WIN) {
        configured(m, WROTE_WIN, &w->new_win, value & 0xFFFF, "WDOG3_WIN");
    }
    return offset <= WIN;
}

static bool watchdog_read(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    const rt_watchdog_t *w = &m->s.watchdog;
    *value = 0;
    if (!clocked(m)) {
        return true;
    }
    look_at_window(m);
    const uint32_t status = (w->cs & ~(rt_now(m) < w->done_ns ? CS_RCS : 0)) | (w->open ? CS_ULK : 0);
    const uint32_t values[4] = {status, (uint32_t)count_now(m) & 0xFFFF, w->toval, w->win};
    if (size != 4 || offset > WIN) {
        return false;
    }
    *value = values[offset / 4];
    return true;
}

static void watchdog_reset(rt1062_t *m) {
    m->s.watchdog = (rt_watchdog_t){.cs = CS_RESET & ~CS_ULK, .toval = 0x400, .from_ns = rt_now(m)};
    rt_irq_set(m, IRQ_RTWDOG, false);
}

/*
 * Out of reset it would bite after 31 ms, and the core never touches it: so the ROM turns it off. Teensy programs
 * unlock it later on, so the ROM sets UPDATE.
 */
void rt_watchdog_after_rom(rt1062_t *m) {
    m->s.watchdog.cs = CS_CMD32EN | CS_RCS | CS_UPDATE | 1u << 8;
}

const rt_device_t rt_wdog3 = {"WDOG3", 0x400BC000, 0x4000, watchdog_read, watchdog_write, watchdog_reset};
