/* SPDX-License-Identifier: MIT */
#include "omni/excitation.h"

#include "../math/math_inline.h"

static bool excitation_is_sound(const omni_excitation_t *plan, uint8_t wheels) {
    const bool wheel = plan->index < wheels || plan->index == OMNI_MAX_WHEELS;
    return plan->place > OMNI_EXCITATION_NONE && plan->place < OMNI_EXCITATION_COUNT && plan->ticks > 0 &&
           plan->ticks <= OMNI_EXCITATION_MAX_TICKS &&
           (plan->place == OMNI_EXCITATION_POSE ? plan->index < OMNI_AXES : wheel);
}

omni_result_t omni_excitation_start(omni_excitation_state_t *exciter, const omni_excitation_t *plan, uint8_t wheels) {
    exciter->ticks_left = 0;
    if (!excitation_is_sound(plan, wheels)) {
        return OMNI_ERR_RANGE;
    }
    if (!omni_is_finite(plan->amplitude) || !omni_is_finite(plan->step_rad) ||
        !omni_is_finite(plan->phase_acceleration_rad)) {
        return OMNI_ERR_NOT_FINITE;
    }
    exciter->plan = *plan;
    exciter->ticks_left = plan->ticks;
    exciter->started = false;
    exciter->phase_rad = 0.0f;
    exciter->step_rad = plan->step_rad;
    return OMNI_OK;
}

void omni_excitation_next(omni_excitation_state_t *exciter) {
    --exciter->ticks_left;
    const omni_excitation_t *plan = &exciter->plan;
    omni_real_t sine;
    omni_real_t cosine;
    omni_sincosf(exciter->phase_rad, &sine, &cosine);
    const bool sweep = plan->step_rad != 0.0f || plan->phase_acceleration_rad != 0.0f;
    exciter->value = plan->amplitude * (sweep ? sine : 1.0f);
    exciter->phase_rad = omni_wrap_pi(exciter->phase_rad + exciter->step_rad);
    exciter->step_rad += plan->phase_acceleration_rad;
}
