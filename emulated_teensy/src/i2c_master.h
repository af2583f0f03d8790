/* SPDX-License-Identifier: MIT */
/** @file i2c_master.h  What the registers of an LPI2C (lpi2c.c) and the master behind them (i2c_master.c) share. */
#ifndef EMULATED_TEENSY_I2C_MASTER_H
#define EMULATED_TEENSY_I2C_MASTER_H

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

/* A master and its wires. Arrays of two: SCL, SDA. */
typedef struct rt_i2c_unit_t {
    const char *name;
    uint32_t clock; /* rt_clock_gate_t */
    uint32_t interrupt;
    uint8_t pad[2];
    uint32_t alternative; /* of both pads */
    uint8_t daisy[2];     /* rt_daisy_t */
    uint8_t daisy_value;  /* of both inputs */
} rt_i2c_unit_t;

extern const rt_i2c_unit_t rt_i2c_units[RT_I2C_UNITS];

/* MSR. */
uint32_t rt_i2c_status(const rt_i2c_t *bus);
/*
 * The line's level gets to the master: alternative, forced input path (an open-drain output has no other) and
 * SELECT_INPUT are right.
 */
bool rt_i2c_hears(const rt1062_t *m, const rt_i2c_t *bus, uint32_t line);
/* Take over the levels that the inputs have now. */
void rt_i2c_listen(rt1062_t *m, rt_i2c_t *bus);

#endif
