/* SPDX-License-Identifier: MIT */
#include "current.h"

void current_draw(random_t *random, uint32_t episode, omni_real_t *values) {
    const omni_real_t stall_A = values[OMNI_PARAM_BAT_V_NOM] / values[OMNI_PARAM_MOT_R];
    const bool limited = random_chance(random, 700000);
    const bool watched = random_chance(random, 700000);
    const omni_real_t limit_A = stall_A * random_between(random, 0.05f, 1.2f);
    const omni_real_t continuous_A = stall_A * random_between(random, 0.02f, 0.5f);
    const bool on = episode % 4 == 1;
    values[OMNI_PARAM_LIM_I] = on && limited && limit_A < 1000.0f ? limit_A : 0.0f;
    values[OMNI_PARAM_SAFE_I] = on && watched && continuous_A < 1000.0f ? continuous_A : 0.0f;
    values[OMNI_PARAM_SAFE_I_TC] = random_between(random, 0.5f, 2.0f);
}
