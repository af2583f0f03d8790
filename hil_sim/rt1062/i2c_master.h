/* SPDX-License-Identifier: MIT */
/** @file i2c_master.h  What the registers of LPI2C1 (lpi2c.c) and the master behind them (i2c_master.c) share. */
#ifndef HIL_SIM_RT1062_I2C_MASTER_H
#define HIL_SIM_RT1062_I2C_MASTER_H

#include "lpi2c.h"
#include "machine.h"

enum {
    RT_SCL = 0,
    RT_SDA = 1,
    RT_MCR_MEN = 1 << 0,
    RT_MSR_TDF = 1 << 0,
    RT_MSR_RDF = 1 << 1,
    RT_MSR_EPF = 1 << 8,
    RT_MSR_SDF = 1 << 9,
    RT_MSR_NDF = 1 << 10,
    RT_MSR_ALF = 1 << 11,
    RT_MSR_FEF = 1 << 12,
    RT_MSR_PLTF = 1 << 13,
    RT_MSR_MBF = 1 << 24,
    RT_MSR_BBF = 1 << 25
};

/* MSR. */
uint32_t rt_i2c_status(const rt_i2c_t *bus);
/*
 * The line's level gets to the master: alternative, forced input path (an open-drain output has no other) and
 * SELECT_INPUT are right.
 */
bool rt_i2c_hears(const rt1062_t *m, uint32_t line);
/* Take over the levels that the inputs have now. */
void rt_i2c_listen(rt1062_t *m);

#endif
