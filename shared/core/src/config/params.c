/* SPDX-License-Identifier: MIT */
#include "omni/params.h"

#include <string.h>

#include "../math/math_inline.h"

int32_t omni_param_find(const char *name) {
    for (int32_t i = 0; i < OMNI_PARAM_COUNT; i++) {
        if (strncmp(omni_param_table[i].name, name, OMNI_PARAM_NAME_LEN) == 0) {
            return i;
        }
    }
    return -1;
}

int32_t omni_builtin_robot_find(const char *name) {
    for (int32_t i = 0; i < omni_builtin_robot_count; i++) {
        if (strcmp(omni_builtin_robots[i].name, name) == 0) {
            return i;
        }
    }
    return -1;
}

void omni_params_defaults(omni_real_t *values) {
    for (int32_t i = 0; i < OMNI_PARAM_COUNT; i++) {
        values[i] = omni_param_table[i].initial;
    }
}

omni_result_t omni_param_check(int32_t index, omni_real_t value, bool armed) {
    if (index < 0 || index >= OMNI_PARAM_COUNT) {
        return OMNI_ERR_UNKNOWN;
    }
    const omni_param_info_t *info = &omni_param_table[index];
    if (!omni_is_finite(value)) {
        return OMNI_ERR_NOT_FINITE;
    }
    if (value < info->minimum || value > info->maximum) {
        return OMNI_ERR_RANGE;
    }
    /* the range of a whole number fits in int32_t, so the conversion is defined */
    if (info->kind == OMNI_PARAM_INT && value != (omni_real_t)(int32_t)value) {
        return OMNI_ERR_RANGE;
    }
    return armed && info->locked_while_armed != 0 ? OMNI_ERR_LOCKED : OMNI_OK;
}
