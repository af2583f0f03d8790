/* SPDX-License-Identifier: MIT */
/* The inline functions get their callable form here. */
#define OMNI_PID_INLINE
#include "pid_inline.h"

void omni_pid_reset(omni_pid_state_t *state) {
    state->integral = 0.0f;
    state->derivative = 0.0f;
    state->last_measurement = 0.0f;
    state->primed = false;
}
