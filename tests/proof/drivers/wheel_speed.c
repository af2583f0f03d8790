/* SPDX-License-Identifier: MIT */
/* Any state of the loops, any gains, references, measurements and supply. */
#include "any.h"

static omni_real_t reference[OMNI_MAX_WHEELS], acceleration[OMNI_MAX_WHEELS], measured[OMNI_MAX_WHEELS];
static omni_real_t duty[OMNI_MAX_WHEELS], voltage_V[OMNI_MAX_WHEELS];

void proof_wheel_speed(void) {
    omni_wheel_speed_config_t config;
    omni_wheel_speed_state_t state;
    ANYTHING(config);
    config.wheels = (uint8_t)Frama_C_interval(0, OMNI_MAX_WHEELS);
    config.duty_limit = Frama_C_float_interval(0.0f, 1.0f);
    ANYTHING(state);
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        state.pid[i].primed = any_bool();
    }
    ANYTHING(reference);
    ANYTHING(acceleration);
    ANYTHING(measured);
    (void)omni_wheel_speed_step(&state, &config, reference, acceleration, measured, any_real(), duty, voltage_V);
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        /*@ check duty_is_bounded: \is_finite(duty[i]) && -1.0 <= duty[i] <= 1.0; */
        /*@ check voltage_is_finite: \is_finite(voltage_V[i]); */
    }
}
