/* SPDX-License-Identifier: MIT */
/**
 * @file schema.h
 * What shared/world.toml says about the numbers of a world and about its faults, as tables. The function
 * hil_world_init() checks against them, and a program that builds a hil_world_config_t by itself can read them.
 */
#ifndef HIL_SIM_SCHEMA_H
#define HIL_SIM_SCHEMA_H

#include "hil_sim/world.h"

/** A number of hil_world_config_t, or several in a row. */
typedef struct hil_number_t {
    const char *name; /**< of the member */
    uint32_t offset;  /**< in hil_world_config_t */
    uint32_t count;   /**< 0: one per wheel */
    bool whole;       /**< int32_t; otherwise double */
    double minimum;   /**< allowed itself, as is the maximum */
    double maximum;
    const char *allowed; /**< the same in words, with the unit */
} hil_number_t;

extern const hil_number_t hil_numbers[];
extern const uint32_t hil_number_count;

/** What a fault needs, by its number in hil_fault_kind_t. */
typedef struct hil_fault_rule_t {
    const char *name;
    bool wheel;     /**< it concerns one wheel */
    double minimum; /**< of its value, allowed itself, as is the maximum */
    double maximum;
    const char *allowed; /**< the same in words, with the unit */
} hil_fault_rule_t;

extern const hil_fault_rule_t hil_fault_rules[HIL_FAULT_KIND_COUNT];

#endif
