/* SPDX-License-Identifier: MIT */
/** @file pid_inline.h  Inline bodies of the functions of omni/pid.h that the tick uses: see math_inline.h. Not part
 * of the API. */
#ifndef OMNI_PID_INLINE_H
#define OMNI_PID_INLINE_H

#include "../math/math_inline.h"
#include "omni/pid.h"

#ifndef OMNI_PID_INLINE
#define OMNI_PID_INLINE OMNI_INLINE
#endif

OMNI_PID_INLINE omni_real_t omni_pid_step(omni_pid_state_t *state, const omni_pid_config_t *config,
                                          omni_real_t reference, omni_real_t measurement, omni_real_t feed_forward) {
    const omni_real_t error = reference - measurement;
    const omni_real_t limit = config->integral_limit;
    const omni_real_t integral = omni_clampf(state->integral + config->ki * config->step_s * error, -limit, limit);
    /* first-order low-pass of the measurement's rate, backward Euler */
    const omni_real_t moved = state->primed ? measurement - state->last_measurement : 0.0f;
    const omni_real_t derivative =
        state->derivative + (moved - config->step_s * state->derivative) / (config->derivative_time_s + config->step_s);
    /* [report eq. 38] as an output: P and I on the error, D on the measurement so that a step of the reference gives no
     * spike */
    const omni_real_t output = config->kp * error + integral - config->kd * derivative + feed_forward;
    /* Any input that is not finite makes the output so, even with gains of 0. */
    if (!omni_is_finite(output)) {
        return 0.0f;
    }
    state->integral = integral;
    state->derivative = derivative;
    state->last_measurement = measurement;
    state->primed = true;
    return output;
}

OMNI_PID_INLINE void omni_pid_limited(omni_pid_state_t *state, const omni_pid_config_t *config, omni_real_t wanted,
                                      omni_real_t applied) {
    const omni_real_t cut = applied - wanted;
    if (!omni_is_finite(cut)) {
        return;
    }
    const omni_real_t per_step = config->ki * config->step_s;
    const omni_real_t share = omni_select(per_step < config->kp, per_step / config->kp, 1.0f);
    const omni_real_t limit = config->integral_limit;
    state->integral = omni_clampf(state->integral + share * cut, -limit, limit);
}

#endif
