/* SPDX-License-Identifier: MIT */
#include "omni/current.h"

#include "../math/invariant.h"
#include "../math/math_inline.h"

/* Back-EMF, as a fraction of the limit's voltage, above which a motor may count as braking. Below it the sign of a
 * blocked wheel's speed is noise. */
static const omni_real_t BRAKING_EMF_FRACTION = 0.05f;
/* Largest R T / L: the current decays within a tick. Largest plausible heat. */
static const omni_real_t MAX_DECAY_EXPONENT = 60.0f;
static const omni_real_t MAX_HEAT = 1e6f;
/* Ticks without a count for which the filter's speed is used: invalid counts stop the robot after three ticks. */
static const omni_real_t TRUSTED_TICKS_WITHOUT_COUNT = 3.0f;
static const omni_real_t MAX_TICKS_WITHOUT_COUNT = 1000.0f;

/* exp(-x) for x >= 0 by scaling and squaring. */
static omni_real_t exponential_decay(omni_real_t x) {
    enum { SQUARINGS = 10 };
    if (!(x < MAX_DECAY_EXPONENT)) {
        return 0.0f;
    }
    const omni_real_t y = x * (1.0f / 1024.0f);
    /* 1 - exp(-x) is squared instead of exp(-x): less cancellation */
    omni_real_t missing = y * (1.0f - y * (0.5f - y * (1.0f / 6.0f)));
    for (int i = 0; i < SQUARINGS; ++i) {
        missing = missing * (2.0f - missing);
    }
    return 1.0f - missing;
}

void omni_current_configure(omni_current_config_t *config, omni_real_t limit_A, omni_real_t continuous_A,
                            omni_real_t heat_s, omni_real_t constant_V_s, omni_real_t resistance_ohm,
                            omni_real_t inductance_H, omni_real_t rad_per_count, omni_real_t step_s) {
    const omni_real_t x = step_s / heat_s; /* at most 0.002: the next term of the series is 3e-9 of it */
    config->limit_enabled = limit_A > 0.0f;
    config->enabled = config->limit_enabled || continuous_A > 0.0f;
    config->limit_V = resistance_ohm * limit_A;
    config->brake_V = BRAKING_EMF_FRACTION * config->limit_V;
    config->constant_V_s = constant_V_s;
    config->conductance_S = 1.0f / resistance_ohm;
    config->one_count_rad_s = rad_per_count / step_s;
    config->current_decay = exponential_decay(resistance_ohm / inductance_H * step_s);
    config->heat_gain = x * (1.0f - x * (0.5f - x * (1.0f / 6.0f)));
    config->inverse_continuous_A2 = continuous_A > 0.0f ? 1.0f / (continuous_A * continuous_A) : 0.0f;
}

static omni_real_t step_heat(const omni_current_config_t *config, omni_real_t heat, omni_real_t current_A) {
    const omni_real_t goal = current_A * current_A * config->inverse_continuous_A2;
    const omni_real_t next = heat + config->heat_gain * (omni_minf(goal, MAX_HEAT) - heat);
    return omni_clampf(next, 0.0f, MAX_HEAT);
}

/* Speed bounded by the time without a count. */
static omni_real_t bounded_speed(omni_real_t *quiet, const omni_current_config_t *config, omni_real_t speed_rad_s,
                                 omni_int_t counts, uint32_t steps) {
    const omni_real_t longer = *quiet + (omni_real_t)steps;
    *quiet = counts != 0 ? 0.0f : omni_minf(longer, MAX_TICKS_WITHOUT_COUNT);
    const omni_real_t most = config->one_count_rad_s / omni_maxf(*quiet, 1.0f);
    return *quiet > TRUSTED_TICKS_WITHOUT_COUNT ? omni_clampf(speed_rad_s, -most, most) : speed_rad_s;
}

void omni_current_estimate(omni_current_state_t *state, const omni_current_config_t *config, uint8_t wheels,
                           const omni_real_t *voltage_V, const omni_real_t *wheel_rad_s, const omni_int_t *counts,
                           bool driven, uint32_t steps) {
    for (uint8_t i = 0; i < wheels; ++i) {
        const omni_real_t speed =
            bounded_speed(&state->ticks_without_count[i], config, wheel_rad_s[i], counts[i], steps);
        const omni_real_t steady_A = (voltage_V[i] - config->constant_V_s * speed) * config->conductance_S;
        if (!omni_is_finite(steady_A)) {
            continue; /* omni_robot_estimate raises the fault for that */
        }
        state->wheel_rad_s[i] = speed;
        for (uint32_t step = 0; step < steps; ++step) {
            const omni_real_t next_A = steady_A + config->current_decay * (state->current_A[i] - steady_A);
            state->current_A[i] = driven ? next_A : 0.0f;
            state->heat[i] = step_heat(config, state->heat[i], state->current_A[i]);
        }
    }
}

omni_real_t omni_current_limit(const omni_current_config_t *config, uint8_t wheels, const omni_real_t *wheel_rad_s,
                               omni_real_t *voltage_V) {
    omni_real_t emf_V[OMNI_MAX_WHEELS];
    omni_real_t push_V[OMNI_MAX_WHEELS];
    omni_real_t factor = 1.0f;
    for (uint8_t i = 0; i < wheels; ++i) {
        const omni_real_t emf = config->constant_V_s * wheel_rad_s[i];
        const omni_real_t push = voltage_V[i] - emf;
        const bool brakes = push * emf < 0.0f && omni_absf(emf) > config->brake_V;
        const omni_real_t size = brakes ? 0.0f : omni_absf(push);
        if (size * factor > config->limit_V) {
            factor = config->limit_V / size;
        }
        emf_V[i] = brakes ? voltage_V[i] : emf;
        push_V[i] = brakes ? 0.0f : push;
    }
    if (factor >= 1.0f) {
        return 1.0f;
    }
    for (uint8_t i = 0; i < wheels; ++i) {
        if (factor < 1.0f) {
            voltage_V[i] = emf_V[i] + factor * push_V[i];
        }
    }
    return factor;
}
