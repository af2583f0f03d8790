/* SPDX-License-Identifier: MIT */
/* CCM (i.MX RT1060 RM, chapter CCM). Reset values: the register tables of the vendor's SVD file. */
#include "machine.h"

#include "registers.h"

/* Places in the table below. */
enum { CACRR, CBCDR, CBCMR, CSCMR1, CSCDR1, CSCDR2, CCGR0 };

static const rt_register_t table[RT_CCM_REGISTERS] = {
    [CACRR] = {0x10, 0x00000001, 0x00000007, 0, "CCM_CACRR"},
    [CBCDR] = {0x14, 0x000A8300, 0x3A071FC0, 0, "CCM_CBCDR"},
    [CBCMR] = {0x18, 0x2DAE8324, 0xFF8CF330, 0, "CCM_CBCMR"},
    [CSCMR1] = {0x1C, 0x04900000, 0x6383FC7F, 0, "CCM_CSCMR1"},
    [CSCDR1] = {0x24, 0x06490B00, 0x0E07387F, 0, "CCM_CSCDR1"},
    [CSCDR2] = {0x38, 0x00029150, 0x01FFFE00, 0, "CCM_CSCDR2"},
    [CCGR0] = {0x68, 0xFFFFFFFF, 0xFFFFFFFF, 0, "CCM_CCGR0"},
    {0x6C, 0xFFFFFFFF, 0xFFFFFFFF, 0, "CCM_CCGR1"},
    {0x70, 0xFC3FFFFF, 0xFFFFFFFF, 0, "CCM_CCGR2"},
    {0x74, 0xFFFFFFCF, 0xFFFFFFFF, 0, "CCM_CCGR3"},
    {0x78, 0xFFFFFFFF, 0xFFFFFFFF, 0, "CCM_CCGR4"},
    {0x7C, 0xFFFFFFFF, 0xFFFFFFFF, 0, "CCM_CCGR5"},
    {0x80, 0xFFFFFFFF, 0xFFFFFFFF, 0, "CCM_CCGR6"},
    {0x84, 0xFFFFFFFF, 0xFFFFFFFF, 0, "CCM_CCGR7"},
};

enum { CDHIPR = 0x48, OSCILLATOR_Hz = 24000000, PLL2_Hz = 528000000, PLL3_Hz = 480000000 };

/* How long a divider's handshake takes: some cycles of the slowest clock that is concerned. The manual gives no figure;
 * 1 us is long for it. */
enum { HANDSHAKE_ns = 1000 };

#define BUSY_ARM_PODF (1u << 16)
#define BUSY_PERIPH_CLK_SEL (1u << 5)
#define BUSY_AHB_PODF (1u << 1)
#define BUSY_SEMC_PODF (1u << 0)

#define PERIPH_CLK_SEL (1u << 25)
#define AHB_PODF (7u << 10)
#define SEMC_PODF (7u << 16)
#define CLK_SEL_OSCILLATOR (1u << 6) /* PERCLK_CLK_SEL and UART_CLK_SEL */
#define LPI2C_CLK_SEL (1u << 18)

/* Bits 13:12 of CBCMR: what PERIPH_CLK2 runs from. */
enum { CLK2_PLL3, CLK2_OSCILLATOR, CLK2_PLL2_BYPASS };
/* Bits 19:18 of CBCMR. */
enum { PRE_PLL2, PRE_PLL2_PFD2, PRE_PLL2_PFD0, PRE_PLL1 };

static uint32_t field(uint32_t value, uint32_t low, uint32_t width) {
    return value >> low & ((1u << width) - 1);
}

bool rt_clock_on(const rt1062_t *m, rt_clock_gate_t gate) {
    return (m->s.ccm.values[CCGR0 + (uint32_t)gate / 16] >> (2 * ((uint32_t)gate % 16)) & 1) != 0;
}

bool rt_clock_needed(rt1062_t *m, rt_clock_gate_t gate, const char *peripheral) {
    const bool on = rt_clock_on(m, gate);
    if (!on) {
        rt_finding(m, RT1062_FINDING_CLOCK, "%s is used while its clock is off", peripheral);
    }
    return on;
}

/* A PFD of PLL2: 18 / FRAC of it [CCM_ANALOG_PFD_528]. */
static uint32_t pll2_pfd_hz(const rt1062_t *m, uint32_t number) {
    const uint32_t pfd = rt_analog_value(m, RT_ANALOG_PFD_528) >> (8 * number);
    const uint32_t fraction = pfd & 0x3F;
    return (pfd & 0x80) != 0 || fraction == 0 ? 0 : (uint32_t)(18ull * PLL2_Hz / fraction);
}

static uint32_t pll1_hz(const rt1062_t *m) {
    if (!rt_pll_runs(m, RT_ANALOG_PLL_ARM)) {
        return OSCILLATOR_Hz; /* bypassed, or not yet locked: nobody may rely on more */
    }
    return OSCILLATOR_Hz / 2 * (rt_analog_value(m, RT_ANALOG_PLL_ARM) & 0x7F);
}

static uint32_t pll3_hz(const rt1062_t *m) {
    return rt_pll_runs(m, RT_ANALOG_PLL_USB1) ? PLL3_Hz : OSCILLATOR_Hz;
}

static uint32_t periph_clk2_hz(const rt1062_t *m) {
    const uint32_t source = field(m->s.ccm.values[CBCMR], 12, 2);
    const uint32_t root = source == CLK2_PLL3 ? pll3_hz(m) : OSCILLATOR_Hz;
    return root / (field(m->s.ccm.values[CBCDR], 27, 3) + 1);
}

static uint32_t pre_periph_hz(const rt1062_t *m) {
    switch (field(m->s.ccm.values[CBCMR], 18, 2)) {
    case PRE_PLL2:
        return PLL2_Hz;
    case PRE_PLL2_PFD2:
        return pll2_pfd_hz(m, 2);
    case PRE_PLL2_PFD0:
        return pll2_pfd_hz(m, 0);
    default:
        return pll1_hz(m) / (m->s.ccm.values[CACRR] + 1);
    }
}

static uint32_t arm_hz(const rt1062_t *m) {
    const uint32_t cbcdr = m->s.ccm.values[CBCDR];
    return ((cbcdr & PERIPH_CLK_SEL) != 0 ? periph_clk2_hz(m) : pre_periph_hz(m)) / (field(cbcdr, 10, 3) + 1);
}

uint32_t rt_clock_hz(const rt1062_t *m, rt_clock_root_t root) {
    const uint32_t *values = m->s.ccm.values;
    const uint32_t ipg = arm_hz(m) / (field(values[CBCDR], 8, 2) + 1);
    switch (root) {
    case RT_ROOT_ARM:
        return arm_hz(m);
    case RT_ROOT_IPG:
        return ipg;
    case RT_ROOT_PERCLK:
        return ((values[CSCMR1] & CLK_SEL_OSCILLATOR) != 0 ? OSCILLATOR_Hz : ipg) / (field(values[CSCMR1], 0, 6) + 1);
    case RT_ROOT_UART:
        return ((values[CSCDR1] & CLK_SEL_OSCILLATOR) != 0 ? OSCILLATOR_Hz : pll3_hz(m) / 6) /
               (field(values[CSCDR1], 0, 6) + 1);
    case RT_ROOT_LPI2C:
        return ((values[CSCDR2] & LPI2C_CLK_SEL) != 0 ? OSCILLATOR_Hz : pll3_hz(m) / 8) /
               (field(values[CSCDR2], 19, 6) + 1);
    }
    return 0;
}

static bool ccm_read(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    if (size == 4 && offset == CDHIPR) {
        *value = rt_now(m) < m->s.ccm.busy_until_ns ? m->s.ccm.busy : 0;
        return true;
    }
    const int32_t place = rt_register_find(table, RT_CCM_REGISTERS, offset);
    if (size != 4 || place < 0) {
        return false;
    }
    *value = m->s.ccm.values[place];
    return true;
}

/* Bits of CDHIPR that this change sets for a while. */
static uint32_t handshakes(int32_t place, uint32_t changed) {
    if (place == CACRR) {
        return changed != 0 ? BUSY_ARM_PODF : 0;
    }
    if (place != CBCDR) {
        return 0;
    }
    return ((changed & PERIPH_CLK_SEL) != 0 ? BUSY_PERIPH_CLK_SEL : 0) |
           ((changed & AHB_PODF) != 0 ? BUSY_AHB_PODF : 0) | ((changed & SEMC_PODF) != 0 ? BUSY_SEMC_PODF : 0);
}

static bool ccm_write(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    const int32_t place = rt_register_find(table, RT_CCM_REGISTERS, offset);
    if (size != 4 || place < 0) {
        return false;
    }
    rt_ccm_t *ccm = &m->s.ccm;
    const uint32_t before = ccm->values[place];
    rt_register_write(m, &table[place], &ccm->values[place], value);
    const uint32_t busy = handshakes(place, before ^ ccm->values[place]);
    if (busy != 0) {
        const uint32_t still = rt_now(m) < ccm->busy_until_ns ? ccm->busy : 0;
        if (still != 0) {
            rt_finding(m, RT1062_FINDING_CLOCK,
                       "%s is changed while another divider's handshake (CDHIPR 0x%X) is under way", table[place].name,
                       (unsigned)still);
        }
        ccm->busy = busy | still;
        ccm->busy_until_ns = rt_now(m) + HANDSHAKE_ns;
    }
    return true;
}

static void ccm_reset(rt1062_t *m) {
    rt_registers_reset(table, RT_CCM_REGISTERS, m->s.ccm.values);
    m->s.ccm.busy = 0;
}

/*
 * 396 MHz and 132 MHz are where clockspeed.c of the core begins (F_CPU_ACTUAL, F_BUS_ACTUAL). Which gates the ROM
 * leaves open is not written down. Here they are those alone that the core uses without opening them: a program that
 * relies on another one is found.
 */
void rt_clocks_after_rom(rt1062_t *m) {
    static const uint16_t open[] = {RT_CLOCK_GPIO1,   RT_CLOCK_GPIO2,   RT_CLOCK_GPIO3,  RT_CLOCK_GPIO4,
                                    RT_CLOCK_GPIO5,   RT_CLOCK_OCOTP,   RT_CLOCK_IOMUXC, RT_CLOCK_IOMUXC_GPR,
                                    RT_CLOCK_SNVS_HP, RT_CLOCK_SNVS_LP, RT_CLOCK_FLEXSPI};
    uint32_t *values = m->s.ccm.values;
    values[CBCDR] = (values[CBCDR] & ~0x300u) | 2u << 8;
    for (uint32_t i = 0; i < 8; i++) {
        values[CCGR0 + i] = 0;
    }
    for (uint32_t i = 0; i < sizeof open / sizeof open[0]; i++) {
        values[CCGR0 + open[i] / 16] |= 3u << (2 * (open[i] % 16));
    }
}

const rt_device_t rt_ccm = {"CCM", 0x400FC000, 0x4000, ccm_read, ccm_write, ccm_reset};
