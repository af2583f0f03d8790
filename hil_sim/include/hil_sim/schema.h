/* SPDX-License-Identifier: MIT */
/**
 * @file schema.h Tables of the world's numbers and faults, generated from shared/world.toml: used by hil_world_init()
 * for its checks, and by programs that build a hil_world_config_t.
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
    const char *allowed; /**< range as text, with the unit */
} hil_number_t;

extern const hil_number_t hil_numbers[];
extern const uint32_t hil_number_count;

/** Properties of a fault, by hil_fault_kind_t. */
typedef struct hil_fault_rule_t {
    const char *name;
    bool wheel;     /**< it affects one wheel */
    double minimum; /**< of its value, allowed itself, as is the maximum */
    double maximum;
    const char *allowed; /**< range as text, with the unit */
} hil_fault_rule_t;

extern const hil_fault_rule_t hil_fault_rules[HIL_FAULT_KIND_COUNT];

#endif
