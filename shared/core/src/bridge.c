/* SPDX-License-Identifier: MIT */
#include "omni/bridge.h"

#include "math_inline.h"

omni_bridge_counts_t omni_bridge_counts(omni_real_t duty, bool drive) {
    omni_bridge_counts_t counts = {0, 0};
    if (!drive) {
        return counts;
    }
    const omni_real_t share = omni_clampf(omni_absf(duty), 0.0f, 1.0f);
    const uint16_t low_steps = (uint16_t)(share * (omni_real_t)OMNI_PWM_STEPS + 0.5f);
    const uint16_t chopped = (uint16_t)(OMNI_PWM_STEPS - low_steps);
    counts.in1 = duty < 0.0f ? chopped : (uint16_t)OMNI_PWM_STEPS;
    counts.in2 = duty > 0.0f ? chopped : (uint16_t)OMNI_PWM_STEPS;
    return counts;
}
