/* SPDX-License-Identifier: MIT */
/**
 * @file analog.h
 * The analog page (CCM_ANALOG, PMU, TEMPMON, XTALOSC24M) and the DCDC converter.
 */
#ifndef EMULATED_TEENSY_ANALOG_H
#define EMULATED_TEENSY_ANALOG_H

#include <stdbool.h>
#include <stdint.h>

#include "emulated_teensy/rt1062.h"

/* Registers of the analog page, in the order of the table in analog.c. Each has SET, CLR and TOG beside it. */
typedef enum rt_analog_register_t {
    RT_ANALOG_PLL_ARM,
    RT_ANALOG_PLL_USB1,
    RT_ANALOG_PLL_SYS,
    RT_ANALOG_PFD_480,
    RT_ANALOG_PFD_528,
    RT_ANALOG_REG_3P0,
    RT_ANALOG_MISC0,
    RT_ANALOG_TEMPSENSE0,
    RT_ANALOG_TEMPSENSE1,
    RT_ANALOG_TEMPSENSE2,
    RT_ANALOG_COUNT
} rt_analog_register_t;

enum { RT_DCDC_REGISTERS = 2, RT_ANALOG_PLLS = 3 /* the first ones of the above */ };

typedef struct rt_analog_t {
    uint32_t values[RT_ANALOG_COUNT];
    uint64_t locked_ns[RT_ANALOG_PLLS]; /* when it has locked; RT_NEVER: it is off */
    uint64_t measured_ns;               /* when TEMPMON's first measurement is done */
    double temperature_degC;            /* of the chip; kept over a reset */
    uint32_t dcdc[RT_DCDC_REGISTERS];
    uint64_t dcdc_settled_ns;
} rt_analog_t;

uint32_t rt_analog_value(const rt1062_t *m, rt_analog_register_t which);
/* The PLL is on, has locked, and its output is not bypassed. */
bool rt_pll_runs(const rt1062_t *m, rt_analog_register_t pll);
/* What the boot ROM leaves here; after the devices' reset. */
void rt_analog_after_rom(rt1062_t *m);

#endif
