/* SPDX-License-Identifier: MIT */
#include "omni/wheel_speed.h"

#include "omni/saturation.h"
#include "pid_inline.h"

/* Below this reference the Coulomb feed-forward fades, so that it does not chatter around standstill. */
static const omni_real_t fade_per_rad_s = 1.0f / 0.05f;

void omni_wheel_speed_reset(omni_wheel_speed_state_t *state) {
    for (int i = 0; i < OMNI_MAX_WHEELS; i++) {
        omni_pid_reset(&state->pid[i]);
    }
}

static bool wheel_inputs_are_finite(uint8_t wheels, const omni_real_t *reference, const omni_real_t *acceleration,
                                    const omni_real_t *measured) {
    omni_real_t sum = 0.0f; /* as in omni_all_finite */
    for (int i = 0; i < wheels; i++) {
        sum += (reference[i] - reference[i]) + (acceleration[i] - acceleration[i]) + (measured[i] - measured[i]);
    }
    return sum == 0.0f;
}

/* [report eq. 24 and 25] solved for the voltage of the reference motion, plus Coulomb friction. */
static omni_real_t feed_forward(const omni_wheel_speed_config_t *config, omni_real_t reference,
                                omni_real_t acceleration) {
    const omni_real_t direction = omni_clampf(reference * fade_per_rad_s, -1.0f, 1.0f);
    return config->ff_speed_V_s * reference + config->ff_acceleration_V_s2 * acceleration +
           config->ff_static_V * direction;
}

omni_real_t omni_wheel_speed_step(omni_wheel_speed_state_t *state, const omni_wheel_speed_config_t *config,
                                  const omni_real_t *reference, const omni_real_t *acceleration,
                                  const omni_real_t *measured, omni_real_t supply_V, omni_real_t *duty,
                                  omni_real_t *voltage_V) {
    omni_real_t wanted[OMNI_MAX_WHEELS];
    const omni_real_t limit_V = config->duty_limit * supply_V;
    for (int i = 0; i < OMNI_MAX_WHEELS; i++) {
        duty[i] = 0.0f;
        voltage_V[i] = 0.0f;
    }
    if (!(supply_V > 0.0f) || !(limit_V > 0.0f) || !omni_is_finite(limit_V) ||
        !wheel_inputs_are_finite(config->wheels, reference, acceleration, measured)) {
        return 0.0f;
    }
    for (int i = 0; i < config->wheels; i++) {
        const omni_real_t forward = feed_forward(config, reference[i], acceleration[i]);
        wanted[i] = omni_pid_step(&state->pid[i], &config->pid, reference[i], measured[i], forward);
        voltage_V[i] = wanted[i];
    }
    /* [report eq. 30] */
    const omni_real_t factor = omni_saturate_direction(voltage_V, config->wheels, limit_V);
    for (int i = 0; i < config->wheels; i++) {
        duty[i] = omni_clampf(voltage_V[i] / supply_V, -config->duty_limit, config->duty_limit);
        omni_pid_limited(&state->pid[i], &config->pid, wanted[i], voltage_V[i]);
    }
    return factor;
}

void omni_wheel_speed_balance(omni_wheel_speed_state_t *state, const omni_wheel_speed_config_t *config) {
    if (config->wheels < OMNI_MAX_WHEELS) {
        return;
    }
    omni_real_t along = 0.0f;
    for (int i = 0; i < OMNI_MAX_WHEELS; i++) {
        along += config->null_direction[i] * state->pid[i].integral;
    }
    if (!omni_is_finite(along)) {
        return;
    }
    const omni_real_t limit = config->pid.integral_limit;
    for (int i = 0; i < OMNI_MAX_WHEELS; i++) {
        const omni_real_t rest = state->pid[i].integral - config->null_direction[i] * along;
        state->pid[i].integral = omni_clampf(rest, -limit, limit);
    }
}
