/* SPDX-License-Identifier: MIT */
/*
 * The analog page (i.MX RT1060 RM, chapters CCM "CCM Analog Memory Map", PMU, TEMPMON) and the DCDC converter (chapter
 * DCDC). Only what the core touches. Reset values: the register tables of the vendor's SVD file.
 */
#include "machine.h"

#include "fuses.h"
#include "registers.h"

static const rt_register_t table[RT_ANALOG_COUNT] = {
    [RT_ANALOG_PLL_ARM] = {0x000, 0x00013063, 0x0001F07F, 1u << 31, "CCM_ANALOG_PLL_ARM"},
    [RT_ANALOG_PLL_USB1] = {0x010, 0x00012000, 0x0001F042, 1u << 31, "CCM_ANALOG_PLL_USB1"},
    [RT_ANALOG_PLL_SYS] = {0x030, 0x00013001, 0x0005F001, 1u << 31, "CCM_ANALOG_PLL_SYS"},
    [RT_ANALOG_PFD_480] = {0x0F0, 0x1311100C, 0xBFBFBFBF, 0x40404040, "CCM_ANALOG_PFD_480"},
    [RT_ANALOG_PFD_528] = {0x100, 0x1018101B, 0xBFBFBFBF, 0x40404040, "CCM_ANALOG_PFD_528"},
    [RT_ANALOG_REG_3P0] = {0x120, 0x00000F74, 0x00001FF7, 0x00030000, "PMU_REG_3P0"},
    [RT_ANALOG_MISC0] = {0x150, 0x04000000, 0x5E017C79, 0x20008080, "PMU_MISC0"},
    [RT_ANALOG_TEMPSENSE0] = {0x180, 0x00000001, 0xFFF00003, 0x000FFF04, "TEMPMON_TEMPSENSE0"},
    [RT_ANALOG_TEMPSENSE1] = {0x190, 0x00000001, 0x0000FFFF, 0, "TEMPMON_TEMPSENSE1"},
    [RT_ANALOG_TEMPSENSE2] = {0x290, 0x00000000, 0x0FFF0FFF, 0, "TEMPMON_TEMPSENSE2"},
};

static const rt_register_t dcdc_table[RT_DCDC_REGISTERS] = {
    {0x0, 0x14030111, 0x1C3FFFFF, 0xA0000000, "DCDC_REG0"},
    {0xC, 0x0000010E, 0x5900071F, 0, "DCDC_REG3"},
};

#define PLL_LOCK (1u << 31)
#define PLL_BYPASS (1u << 16)
#define PLL_ENABLE (1u << 13)
#define PLL_POWER (1u << 12) /* PLL_USB1: power; the others: power down */

#define MEASURE_TEMP (1u << 1)
#define TEMP_FINISHED (1u << 2)
#define TEMP_POWER_DOWN (1u << 0)

#define STS_DC_OK (1u << 31)
#define REG3_TRG 0x1Fu

enum {
    IRQ_TEMPERATURE = 63,
    IRQ_TEMPERATURE_PANIC = 64,
    /* The manual gives no time: five cycles of the 32.768 kHz clock that TEMPMON counts by, rounded up. */
    MEASURE_ns = 153000,
    /* The manual gives no time for the converter to settle either. */
    DCDC_SETTLE_ns = 50000
};

/* Lock times in cycles of 24 MHz (data sheet IMXRT1060CEC, "PLL electrical parameters"), as ns. */
static const uint32_t lock_ns[RT_ANALOG_PLLS] = {2250 * 1000 / 24, 383 * 1000 / 24, 11250 * 1000 / 24};

uint32_t rt_analog_value(const rt1062_t *m, rt_analog_register_t which) {
    return m->s.analog.values[which];
}

bool rt_pll_runs(const rt1062_t *m, rt_analog_register_t pll) {
    const uint32_t value = m->s.analog.values[pll];
    return (value & PLL_ENABLE) != 0 && (value & PLL_BYPASS) == 0 && rt_now(m) >= m->s.analog.locked_ns[pll];
}

/* Counts of the temperature sensor: a straight line through the two calibration points of fuse ANA1 (as tempmon.c of
 * the core reads it). */
static uint32_t temperature_count(const rt1062_t *m) {
    const double hot_degC = (double)(RT_FUSE_ANA1 & 0xFF);
    const double hot = (double)(RT_FUSE_ANA1 >> 8 & 0xFFF);
    const double room = (double)(RT_FUSE_ANA1 >> 20);
    const double count = hot + (hot_degC - m->s.analog.temperature_degC) * (room - hot) / (hot_degC - 25.0);
    return count < 0 ? 0 : count > 0xFFF ? 0xFFF : (uint32_t)count;
}

static bool measuring(const rt1062_t *m) {
    return (m->s.analog.values[RT_ANALOG_TEMPSENSE0] & (MEASURE_TEMP | TEMP_POWER_DOWN)) == MEASURE_TEMP;
}

/* Fewer counts are hotter. */
static void update_alarms(rt1062_t *m) {
    const uint32_t count = temperature_count(m);
    rt_irq_set(m, IRQ_TEMPERATURE, measuring(m) && count <= m->s.analog.values[RT_ANALOG_TEMPSENSE0] >> 20);
    rt_irq_set(m, IRQ_TEMPERATURE_PANIC, measuring(m) && count <= m->s.analog.values[RT_ANALOG_TEMPSENSE2] >> 16);
}

void rt1062_set_temperature(rt1062_t *m, double degC) {
    m->s.analog.temperature_degC = degC;
    update_alarms(m);
}

static uint32_t shown(const rt1062_t *m, uint32_t which) {
    const rt_analog_t *analog = &m->s.analog;
    const uint32_t kept = analog->values[which];
    if (which < RT_ANALOG_PLLS) {
        return kept | (rt_now(m) >= analog->locked_ns[which] ? PLL_LOCK : 0);
    }
    if (which == RT_ANALOG_TEMPSENSE0 && measuring(m) && rt_now(m) >= analog->measured_ns) {
        return kept | TEMP_FINISHED | temperature_count(m) << 8;
    }
    return kept;
}

static bool powered(uint32_t pll, uint32_t value) {
    return ((value & PLL_POWER) != 0) == (pll == RT_ANALOG_PLL_USB1);
}

/* A PLL locks anew when it gets power or another ratio. */
static void pll_written(rt1062_t *m, uint32_t pll, uint32_t before) {
    const uint32_t value = m->s.analog.values[pll];
    const uint32_t ratio = pll == RT_ANALOG_PLL_ARM ? 0x7F : pll == RT_ANALOG_PLL_USB1 ? 2 : 1;
    if (!powered(pll, value)) {
        m->s.analog.locked_ns[pll] = RT_NEVER;
    } else if (!powered(pll, before) || ((value ^ before) & ratio) != 0) {
        m->s.analog.locked_ns[pll] = rt_now(m) + lock_ns[pll];
    }
}

static void temperature_written(rt1062_t *m, bool measured_before) {
    if (measuring(m) && !measured_before) {
        m->s.analog.measured_ns = rt_now(m) + MEASURE_ns;
    }
    update_alarms(m);
}

static bool analog_read(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    const int32_t place = rt_register_find(table, RT_ANALOG_COUNT, offset & ~0xFu);
    if (size != 4 || place < 0) {
        return false;
    }
    *value = shown(m, (uint32_t)place); /* SET, CLR and TOG read like the register itself */
    return true;
}

static bool analog_write(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    const int32_t place = rt_register_find(table, RT_ANALOG_COUNT, offset & ~0xFu);
    if (size != 4 || place < 0) {
        return false;
    }
    uint32_t *kept = &m->s.analog.values[place];
    const uint32_t before = *kept;
    const bool measured_before = measuring(m);
    const uint32_t results[4] = {value, before | value, before & ~value, before ^ value};
    rt_register_write(m, &table[place], kept, results[offset >> 2 & 3]);
    if (place < RT_ANALOG_PLLS) {
        pll_written(m, (uint32_t)place, before);
    } else if (place >= RT_ANALOG_TEMPSENSE0) {
        temperature_written(m, measured_before);
    }
    return true;
}

static void analog_reset(rt1062_t *m) {
    rt_registers_reset(table, RT_ANALOG_COUNT, m->s.analog.values);
    for (uint32_t i = 0; i < RT_ANALOG_PLLS; i++) {
        m->s.analog.locked_ns[i] = RT_NEVER;
    }
    update_alarms(m);
}

static bool dcdc_read(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    const int32_t place = rt_register_find(dcdc_table, RT_DCDC_REGISTERS, offset);
    if (size != 4 || place < 0) {
        return false;
    }
    const bool settled = rt_now(m) >= m->s.analog.dcdc_settled_ns;
    *value = m->s.analog.dcdc[place] | (place == 0 && settled ? STS_DC_OK : 0);
    return true;
}

static bool dcdc_write(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    const int32_t place = rt_register_find(dcdc_table, RT_DCDC_REGISTERS, offset);
    if (size != 4 || place < 0) {
        return false;
    }
    if (!rt_clock_on(m, RT_CLOCK_DCDC)) {
        rt_finding(m, RT1062_FINDING_CLOCK, "%s is written while CCM_CCGR6_DCDC is off", dcdc_table[place].name);
    }
    const uint32_t before = m->s.analog.dcdc[place];
    rt_register_write(m, &dcdc_table[place], &m->s.analog.dcdc[place], value);
    if (place == 1 && ((before ^ value) & REG3_TRG) != 0) {
        m->s.analog.dcdc_settled_ns = rt_now(m) + DCDC_SETTLE_ns;
    }
    return true;
}

static void dcdc_reset(rt1062_t *m) {
    rt_registers_reset(dcdc_table, RT_DCDC_REGISTERS, m->s.analog.dcdc);
    m->s.analog.dcdc_settled_ns = 0;
}

/*
 * PLL1 and PLL2 run: 396 MHz is where clockspeed.c of the core begins. PLL3 has power because the flash controller's
 * clock comes from it. The core's usb_pll_start() looks at the rest of its bits one by one and sets what is missing.
 */
void rt_analog_after_rom(rt1062_t *m) {
    uint32_t *values = m->s.analog.values;
    values[RT_ANALOG_PLL_ARM] = PLL_ENABLE | 66;
    values[RT_ANALOG_PLL_USB1] = PLL_ENABLE | PLL_POWER;
    values[RT_ANALOG_PLL_SYS] = PLL_ENABLE | 1;
    for (uint32_t i = 0; i < RT_ANALOG_PLLS; i++) {
        m->s.analog.locked_ns[i] = rt_now(m);
    }
}

const rt_device_t rt_analog = {"CCM_ANALOG", 0x400D8000, 0x1000, analog_read, analog_write, analog_reset};
const rt_device_t rt_dcdc = {"DCDC", 0x40080000, 0x4000, dcdc_read, dcdc_write, dcdc_reset};
