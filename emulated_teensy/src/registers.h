/* SPDX-License-Identifier: MIT */
/**
 * @file registers.h
 * Registers that keep what is written into them, as a table. What they do beyond that is their device's own affair.
 */
#ifndef EMULATED_TEENSY_REGISTERS_H
#define EMULATED_TEENSY_REGISTERS_H

#include "machine.h"

typedef struct rt_register_t {
    uint16_t offset;
    uint32_t reset;    /* after a reset */
    uint32_t writable; /* bits that a write changes */
    uint32_t
        fixed; /* bits that a write may hold at any level without effect: status, flags that the device looks after */
    const char *name;
} rt_register_t;

#define RT_REGISTER_COUNT(table) ((uint32_t)(sizeof(table) / sizeof((table)[0])))

/* @return its place in the table, -1: there is none at this offset. */
int32_t rt_register_find(const rt_register_t *table, uint32_t count, uint32_t offset);
void rt_registers_reset(const rt_register_t *table, uint32_t count, uint32_t *values);
/* Write `value`; a reserved bit that it would set is refused (rt_refuse), and nothing is written. */
void rt_register_write(rt1062_t *m, const rt_register_t *entry, uint32_t *kept, uint32_t value);

#endif
