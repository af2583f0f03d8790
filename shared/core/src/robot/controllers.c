/* SPDX-License-Identifier: MIT */
#include "controllers.h"

#include <stddef.h>

#define OMNI_ROW(NAME, name) [OMNI_CTL_MODE_##NAME] = &omni_controller_row_##name,
const omni_controller_t *const omni_controllers[OMNI_CTL_MODE_COUNT] = {OMNI_CTL_MODE_ROWS(OMNI_ROW)};
#undef OMNI_ROW

#define OMNI_ROW(NAME, name) [OMNI_CTL_MODE_##NAME] = #name,
static const char *const controller_names[OMNI_CTL_MODE_COUNT] = {OMNI_CTL_MODE_ROWS(OMNI_ROW)};
#undef OMNI_ROW

const char *omni_controller_name(uint8_t controller) {
    return controller < OMNI_CTL_MODE_COUNT ? controller_names[controller] : NULL;
}
