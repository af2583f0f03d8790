/* SPDX-License-Identifier: MIT */
#include "omni/current.h"

#include "../math/invariant.h"
#include "../math/math_inline.h"

/* A motor counts as braking from this share of the limit's voltage on as back-EMF. Below it the wheel as good as
 * stands: the speed of a blocked wheel is noise of either sign. */
static const omni_real_t BRAKE_SHARE = 0.05f;
/* Beyond this a current is gone after a tick; and nothing that can be believed makes more heat. */
static const omni_real_t GONE = 60.0f;
static const omni_real_t MOST_HEAT = 1e6f;
/* Counts that cannot be used may hide a turning wheel for three ticks, then they stop the robot. */
static const omni_real_t QUIET = 3.0f;
static const omni_real_t MOST_QUIET = 1000.0f;

/* exp(-x) for x >= 0: the series for a small share of x, squared up. */
static omni_real_t share_left(omni_real_t x) {
    enum { SQUARINGS = 10 };
    if (!(x < GONE)) {
        return 0.0f;
    }
    const omni_real_t y = x * (1.0f / 1024.0f);
    /* minus what is missing to 1: 1 would swallow its digits */
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
    config->limited = limit_A > 0.0f;
    config->watched = config->limited || continuous_A > 0.0f;
    config->limit_V = resistance_ohm * limit_A;
    config->brake_V = BRAKE_SHARE * config->limit_V;
    config->constant_V_s = constant_V_s;
    config->per_ohm = 1.0f / resistance_ohm;
    config->count_rad_s = rad_per_count / step_s;
    config->keep = share_left(resistance_ohm / inductance_H * step_s);
    config->heat_step = x * (1.0f - x * (0.5f - x * (1.0f / 6.0f)));
    config->per_continuous2 = continuous_A > 0.0f ? 1.0f / (continuous_A * continuous_A) : 0.0f;
}

static omni_real_t heat_after(const omni_current_config_t *config, omni_real_t heat, omni_real_t current_A) {
    const omni_real_t goal = current_A * current_A * config->per_continuous2;
    const omni_real_t next = heat + config->heat_step * (omni_select(goal < MOST_HEAT, goal, MOST_HEAT) - heat);
    return omni_clampf(next, 0.0f, MOST_HEAT);
}

/* The speed at which a wheel may turn that has given no count for so long. */
static omni_real_t believed_speed(omni_real_t *quiet, const omni_current_config_t *config, omni_real_t speed_rad_s,
                                  omni_int_t counts, uint32_t steps) {
    const omni_real_t longer = *quiet + (omni_real_t)steps;
    *quiet = omni_select(counts != 0, 0.0f, omni_select(longer < MOST_QUIET, longer, MOST_QUIET));
    const omni_real_t most = config->count_rad_s / omni_select(*quiet > 1.0f, *quiet, 1.0f);
    return omni_select(*quiet > QUIET, omni_clampf(speed_rad_s, -most, most), speed_rad_s);
}

void omni_current_estimate(omni_current_state_t *state, const omni_current_config_t *config, uint8_t wheels,
                           const omni_real_t *voltage_V, const omni_real_t *wheel_rad_s, const omni_int_t *counts,
                           bool driven, uint32_t steps) {
    for (uint8_t i = 0; i < wheels; ++i) {
        const omni_real_t speed = believed_speed(&state->quiet[i], config, wheel_rad_s[i], counts[i], steps);
        const omni_real_t steady_A = (voltage_V[i] - config->constant_V_s * speed) * config->per_ohm;
        if (!omni_is_finite(steady_A)) {
            continue; /* another fault stops the robot for that */
        }
        state->wheel_rad_s[i] = speed;
        for (uint32_t step = 0; step < steps; ++step) {
            const omni_real_t next_A = steady_A + config->keep * (state->current_A[i] - steady_A);
            state->current_A[i] = driven ? next_A : 0.0f;
            state->heat[i] = heat_after(config, state->heat[i], state->current_A[i]);
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
        const omni_flag_t brakes = (push * emf < 0.0f) & (omni_absf(emf) > config->brake_V);
        const omni_real_t size = omni_select(brakes, 0.0f, omni_absf(push));
        factor = omni_select(size * factor > config->limit_V, config->limit_V / size, factor);
        emf_V[i] = omni_select(brakes, voltage_V[i], emf);
        push_V[i] = omni_select(brakes, 0.0f, push);
    }
    if (omni_all(factor >= 1.0f)) {
        return 1.0f;
    }
    for (uint8_t i = 0; i < wheels; ++i) {
        voltage_V[i] = omni_select(factor < 1.0f, emf_V[i] + factor * push_V[i], voltage_V[i]);
    }
    return factor;
}
