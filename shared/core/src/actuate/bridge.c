/* SPDX-License-Identifier: MIT */
#include "omni/bridge.h"

#include "../math/math_inline.h"

omni_bridge_counts_t omni_bridge_counts(omni_real_t duty, bool drive) {
    const uint16_t steps = OMNI_PWM_STEPS;
    omni_bridge_counts_t counts = {0, 0};
    if (!drive) {
        return counts;
    }
    const omni_real_t share = omni_clampf(omni_absf(duty), 0.0f, 1.0f);
    const omni_steps_t low_steps = (omni_steps_t)(share * (omni_real_t)steps + 0.5f);
    const omni_steps_t chopped = (omni_steps_t)(steps - low_steps);
    counts.in1 = omni_select(duty < 0.0f, chopped, (omni_steps_t)steps);
    counts.in2 = omni_select(duty > 0.0f, chopped, (omni_steps_t)steps);
    return counts;
}
