/* SPDX-License-Identifier: MIT */
#include "gpr.h"

#include "devices.h"
#include "gpio.h"
#include "lpi2c.h"
#include "machine.h"
#include "xbar.h"

enum {
    GPR6 = 6,
    GPR14 = 14,
    GPR16 = 16,
    GPR17 = 17,
    GPR26 = 26,
    GPR29 = 29,
    FLEXRAM_BY_REGISTER = 1 << 2, /* GPR16.FLEXRAM_BANK_CFG_SEL; else the fuses decide */
    GPR16_RESET = 0x00200003
};

/* Bits that a write may set. GPR6: XBAR_DIR_SEL_4..19 alone; no quad timer takes a pad here. */
static uint32_t writable(uint32_t number) {
    switch (number) {
    case GPR6:
        return 0xFFFF0000u;
    case GPR14:
        return 0x00FF0000u; /* CM7_CFGITCMSZ, CM7_CFGDTCMSZ */
    case GPR16:
        return 0x00200007u; /* INIT_ITCM_EN, INIT_DTCM_EN, FLEXRAM_BANK_CFG_SEL; bit 21 as the core writes it */
    case GPR17:
    case GPR26:
    case GPR26 + 1:
    case GPR26 + 2:
    case GPR29:
        return 0xFFFFFFFFu;
    default:
        return 0;
    }
}

static bool read(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t *value) {
    if (size != 4 || offset / 4 >= RT_GPRS || writable(offset / 4) == 0) {
        return false;
    }
    *value = m->s.gpr.value[offset / 4];
    return true;
}

static bool write(rt1062_t *m, uint32_t offset, uint32_t size, uint32_t value) {
    const uint32_t number = offset / 4;
    if (size != 4 || number >= RT_GPRS || (value & ~writable(number)) != 0) {
        return false;
    }
    rt_i2c_sync(m);
    m->s.gpr.value[number] = value;
    if ((number == GPR16 || number == GPR17) && (m->s.gpr.value[GPR16] & FLEXRAM_BY_REGISTER) != 0) {
        rt_flexram_configured(m, m->s.gpr.value[GPR17]);
    }
    if (number >= GPR26 && number <= GPR29) {
        rt_gpio_owners_changed(m);
    }
    rt_enc_inputs_changed(m);
    rt_i2c_sync(m);
    return true;
}

static void reset(rt1062_t *m) {
    for (uint32_t i = 0; i < RT_GPRS; i++) {
        m->s.gpr.value[i] = 0;
    }
    m->s.gpr.value[GPR16] = GPR16_RESET;
}

const rt_device_t rt_iomuxc_gpr = {"IOMUXC_GPR", 0x400AC000, 0x4000, read, write, reset};
