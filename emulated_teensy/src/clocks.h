/* SPDX-License-Identifier: MIT */
/**
 * @file clocks.h
 * CCM: clock gates and dividers (i.MX RT1060 RM, chapter CCM; names, bits and gate numbers as in the core's imxrt.h).
 *
 * Frequencies follow the registers, so a wrong divider shows at the peripheral that it feeds. Time itself does not: an
 * instruction takes rt1062_config_t.instruction_ns whatever the processor's clock is.
 */
#ifndef EMULATED_TEENSY_CLOCKS_H
#define EMULATED_TEENSY_CLOCKS_H

#include <stdbool.h>
#include <stdint.h>

#include "emulated_teensy/rt1062.h"

enum { RT_CCM_REGISTERS = 14 };

typedef struct rt_ccm_t {
    uint32_t values[RT_CCM_REGISTERS]; /* as listed in clocks.c */
    uint32_t busy;                     /* CDHIPR: handshakes under way */
    uint64_t busy_until_ns;
} rt_ccm_t;

/* A clock gate: CGm of CCGRn is 16 n + m. */
typedef enum rt_clock_gate_t {
    RT_CLOCK_GPIO2 = 16 * 0 + 15,
    RT_CLOCK_LPSPI1 = 16 * 1 + 0,
    RT_CLOCK_ADC2 = 16 * 1 + 4,
    RT_CLOCK_PIT = 16 * 1 + 6,
    RT_CLOCK_ADC1 = 16 * 1 + 8,
    RT_CLOCK_GPIO1 = 16 * 1 + 13,
    RT_CLOCK_GPIO5 = 16 * 1 + 15,
    RT_CLOCK_LPI2C1 = 16 * 2 + 3,
    RT_CLOCK_LPI2C3 = 16 * 2 + 5,
    RT_CLOCK_OCOTP = 16 * 2 + 6,
    RT_CLOCK_XBAR1 = 16 * 2 + 11,
    RT_CLOCK_GPIO3 = 16 * 2 + 13,
    RT_CLOCK_LPUART6 = 16 * 3 + 3,
    RT_CLOCK_GPIO4 = 16 * 3 + 6,
    RT_CLOCK_WDOG1 = 16 * 3 + 8,
    RT_CLOCK_IOMUXC = 16 * 4 + 1,
    RT_CLOCK_IOMUXC_GPR = 16 * 4 + 2,
    RT_CLOCK_PWM1 = 16 * 4 + 8,
    RT_CLOCK_PWM2 = 16 * 4 + 9,
    RT_CLOCK_PWM3 = 16 * 4 + 10,
    RT_CLOCK_PWM4 = 16 * 4 + 11,
    RT_CLOCK_ENC1 = 16 * 4 + 12,
    RT_CLOCK_ENC2 = 16 * 4 + 13,
    RT_CLOCK_ENC3 = 16 * 4 + 14,
    RT_CLOCK_ENC4 = 16 * 4 + 15,
    RT_CLOCK_LPI2C4 = 16 * 6 + 12,
    RT_CLOCK_WDOG3 = 16 * 5 + 2,
    RT_CLOCK_SNVS_HP = 16 * 5 + 14,
    RT_CLOCK_SNVS_LP = 16 * 5 + 15,
    RT_CLOCK_USBOH3 = 16 * 6 + 0,
    RT_CLOCK_DCDC = 16 * 6 + 3,
    RT_CLOCK_FLEXSPI = 16 * 6 + 5,
    RT_CLOCK_QTIMER4 = 16 * 6 + 8,
    RT_CLOCK_QTIMER1 = 16 * 6 + 13,
    RT_CLOCK_QTIMER2 = 16 * 6 + 14,
    RT_CLOCK_QTIMER3 = 16 * 6 + 15
} rt_clock_gate_t;

/* A clock that peripherals run from. */
typedef enum rt_clock_root_t {
    RT_ROOT_ARM,    /* the processor */
    RT_ROOT_IPG,    /* the peripherals' bus: ADC, ENC, XBAR, WDOG registers */
    RT_ROOT_PERCLK, /* PIT, GPT */
    RT_ROOT_UART,   /* LPUART1 .. 8 */
    RT_ROOT_LPI2C   /* LPI2C1 .. 4 */
} rt_clock_root_t;

/* The gate is open while the processor runs. Says nothing to the user: rt_clock_needed() does. */
bool rt_clock_on(const rt1062_t *m, rt_clock_gate_t gate);
/* The same for a peripheral that is being used: a closed gate is a finding that names it. */
bool rt_clock_needed(rt1062_t *m, rt_clock_gate_t gate, const char *peripheral);
/* Frequency [Hz] as the dividers and PLLs stand; 0: its source is off. */
uint32_t rt_clock_hz(const rt1062_t *m, rt_clock_root_t root);
/* What the boot ROM leaves in the clock registers; after the devices' reset. */
void rt_clocks_after_rom(rt1062_t *m);

#endif
