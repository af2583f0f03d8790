/* SPDX-License-Identifier: MIT */
/* SNVS (i.MX RT1060 RM, chapter SNVS) as startup.c and rtc.c of the core use it. */
#include "machine.h"

enum { HPCR = 0x08, HPRTCMR = 0x24, HPRTCLR = 0x28, LPCR = 0x38, LPSRTCMR = 0x50, LPSRTCLR = 0x54, RTC_Hz = 32768 };

#define RTC_EN (1u << 0)          /* HPCR.RTC_EN and LPCR.SRTC_ENV */
#define HP_TS (1u << 16)          /* HPCR: take the low-power counter over */
#define HPCR_WRITABLE 0x0F0000F1u /* BTN_*, PI_FREQ and RTC_EN; alarms and calibration are not modelled */
#define LPCR_TOP (1u << 6)        /* turn the supply off */
#define LPCR_WRITABLE 0x00FF00A1u
#define LPCR_RESET 0x20u
#define COUNT_MASK ((1ull << 47) - 1)

static uint64_t count_now(const rt1062_t *m, const rt_rtc_t *rtc) {
    if ((rtc->control & RTC_EN) == 0) {
        return rtc->count;
    }
    const uint64_t elapsed_ns = rt_now(m) - rtc->from_ns;
    const uint64_t counts = elapsed_ns / 1000000000u * RTC_Hz + elapsed_ns % 1000000000u * RTC_Hz / 1000000000u;
    return (rtc->count + counts) & COUNT_MASK;
}

static void set_count(rt1062_t *m, rt_rtc_t *rtc, uint64_t count) {
    rtc->count = count & COUNT_MASK;
    rtc->from_ns = rt_now(m);
}

static bool snvs_read(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    const rt_snvs_t *snvs = &m->s.snvs;
    switch (size == 4 ? offset : UINT32_MAX) {
    case HPCR:
        *value = snvs->high.control;
        return true;
    case HPRTCMR:
        *value = (uint32_t)(count_now(m, &snvs->high) >> 32);
        return true;
    case HPRTCLR:
        *value = (uint32_t)count_now(m, &snvs->high);
        return true;
    case LPCR:
        *value = snvs->low.control;
        return true;
    case LPSRTCMR:
        *value = (uint32_t)(count_now(m, &snvs->low) >> 32);
        return true;
    case LPSRTCLR:
        *value = (uint32_t)count_now(m, &snvs->low);
        return true;
    default:
        return false;
    }
}

static void control_written(rt1062_t *m, rt_rtc_t *rtc, uint32_t writable, uint32_t value) {
    set_count(m, rtc, count_now(m, rtc));
    rtc->control = (rtc->control & ~writable) | (value & writable);
}

static void high_control_written(rt1062_t *m, uint32_t value) {
    rt_snvs_t *snvs = &m->s.snvs;
    if ((value & ~(HPCR_WRITABLE | HP_TS) & ~snvs->high.control) != 0) {
        rt_refuse(m, "SNVS_HPCR: 0x%08X asks for alarms or calibration, which the model has not", (unsigned)value);
        return;
    }
    const bool synchronize = (value & HP_TS) != 0;
    control_written(m, &snvs->high, HPCR_WRITABLE | HP_TS, value);
    if (synchronize) {
        set_count(m, &snvs->high, count_now(m, &snvs->low));
    }
}

static void low_control_written(rt1062_t *m, uint32_t value) {
    if ((value & LPCR_TOP) != 0) {
        rt_refuse(m, "SNVS_LPCR.TOP: the program turned its own supply off");
        return;
    }
    control_written(m, &m->s.snvs.low, LPCR_WRITABLE, value);
}

/* The counter may only be set while it stands (chapter SNVS, "Setting the SRTC"). */
static void low_count_written(rt1062_t *m, uint64_t count) {
    if ((m->s.snvs.low.control & RTC_EN) != 0) {
        rt_refuse(m, "SNVS_LPSRTC is set while it runs; the chip leaves open what becomes of it");
        return;
    }
    set_count(m, &m->s.snvs.low, count);
}

static bool snvs_write(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    const uint64_t low = m->s.snvs.low.count;
    switch (size == 4 ? offset : UINT32_MAX) {
    case HPCR:
        high_control_written(m, value);
        return true;
    case LPCR:
        low_control_written(m, value);
        return true;
    case LPSRTCMR:
        low_count_written(m, (uint64_t)value << 32 | (uint32_t)low);
        return true;
    case LPSRTCLR:
        low_count_written(m, (low & ~(uint64_t)UINT32_MAX) | value);
        return true;
    default:
        return false;
    }
}

static void snvs_reset(rt1062_t *m) {
    m->s.snvs.high = (rt_rtc_t){0};
    if ((m->s.reset_flags & RT_RESET_POWER) != 0) {
        m->s.snvs.low = (rt_rtc_t){.control = LPCR_RESET};
    }
}

const rt_device_t rt_snvs = {"SNVS", 0x400D4000, 0x4000, snvs_read, snvs_write, snvs_reset};
