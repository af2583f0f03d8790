/* SPDX-License-Identifier: MIT */
/**
 * @file params.h
 * Parameter table, generated from shared/params.toml, addressed by index. A parameter set is a
 * plain array of OMNI_PARAM_COUNT values.
 */
#ifndef OMNI_PARAMS_H
#define OMNI_PARAMS_H

#include "omni/params_gen.h"
#include "omni/types.h"

enum { OMNI_PARAM_NAME_LEN = 16 }; /**< MAVLink: 16 characters, not terminated when full */

typedef enum omni_param_kind_t {
    OMNI_PARAM_REAL = 0,
    OMNI_PARAM_INT, /**< whole numbers only; bools and enums too */
} omni_param_kind_t;

typedef struct omni_param_info_t {
    const char *name; /**< <= 16 characters */
    const char *unit;
    omni_real_t minimum;
    omni_real_t maximum;
    omni_real_t initial; /**< default */
    uint8_t kind;        /**< omni_param_kind_t */
    uint8_t locked_while_armed;
    uint16_t storage_key; /**< hash of the name, unique in the table; identifies a stored value */
} omni_param_info_t;

/** Parameter set of a built-in robot file. */
typedef struct omni_builtin_robot_t {
    const char *name;
    omni_real_t values[OMNI_PARAM_COUNT];
} omni_builtin_robot_t;

extern const omni_param_info_t omni_param_table[OMNI_PARAM_COUNT];
extern const omni_builtin_robot_t omni_builtin_robots[];
extern const int32_t omni_builtin_robot_count;

/** Index of a name of at most 16 characters (need not be terminated at 16), or -1. */
int32_t omni_param_find(const char *name);

/** Index of a built-in robot by name, or -1. */
int32_t omni_builtin_robot_find(const char *name);

/* Old names, for one more release: a preset is a set of gains. */
#define omni_robot_preset_t omni_builtin_robot_t
#define omni_robot_presets omni_builtin_robots
#define omni_robot_preset_count omni_builtin_robot_count
#define omni_robot_preset_find omni_builtin_robot_find

/** Fill all values with the defaults of params.toml. */
void omni_params_defaults(omni_real_t *values);

/**
 * May this value be set? @return OMNI_OK, OMNI_ERR_UNKNOWN (index), OMNI_ERR_NOT_FINITE, OMNI_ERR_RANGE (outside
 * min..max, or not a whole number), OMNI_ERR_LOCKED.
 */
omni_result_t omni_param_check(int32_t index, omni_real_t value, bool armed);

#endif
