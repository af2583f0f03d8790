/* SPDX-License-Identifier: MIT */
#include "omni/original_law.h"

#include <string.h>

#include "../math/invariant.h"
#include "omni/saturation.h"
#include "pose_control.h"

omni_original_config_t omni_original_defaults(omni_real_t step_s, omni_real_t rad_per_count) {
    omni_original_config_t config = {
        .lambda = 14.0f,
        .k = 0.01f,
        .motor_p = 10.0f,
        .motor_i = 30.0f,
        .wheel_limit = 4.0f,
        .rad_per_count = rad_per_count,
    };
    const omni_real_t ticks = omni_clampf(0.02f / step_s + 0.5f, 1.0f, 65535.0f);
    config.period_ticks = (uint16_t)ticks;
    config.period_s = step_s * (omni_real_t)config.period_ticks;
    return config;
}

void omni_original_reset(omni_original_state_t *state) {
    memset(state, 0, sizeof *state);
}

/* Put a sample into the window and return W: sum / 100. Recomputed each time, so rounding does not accumulate. */
static omni_real_t windowed_sum(omni_real_t window[OMNI_ORIGINAL_WINDOW], uint8_t slot, omni_real_t sample) {
    omni_real_t sum = 0.0f;
    window[slot] = sample;
    for (int i = 0; i < OMNI_ORIGINAL_WINDOW; i++) {
        sum += window[i];
    }
    return sum / (omni_real_t)OMNI_ORIGINAL_WINDOW;
}

static omni_twist_t position_law(omni_original_state_t *state, const omni_original_config_t *config,
                                 const omni_pose_t *pose, const omni_pose_t *reference, const omni_twist_t *rate) {
    omni_real_t error[OMNI_AXES];
    omni_real_t wanted[OMNI_AXES] = {rate->vx, rate->vy, rate->wz};
    omni_pose_error(pose, reference, error);
    for (int axis = 0; axis < OMNI_AXES; axis++) {
        const omni_real_t integral = windowed_sum(state->pose_window[axis], state->next, error[axis]);
        const omni_real_t surface = error[axis] + config->lambda * integral;
        wanted[axis] += -config->lambda * error[axis] - config->k * omni_signf(surface);
    }
    return (omni_twist_t){wanted[0], wanted[1], wanted[2]};
}

static void motor_law(omni_original_state_t *state, const omni_original_config_t *config, uint8_t wheels,
                      omni_real_t supply_V) {
    for (uint8_t i = 0; i < wheels; i++) {
        const omni_real_t speed = (omni_real_t)state->moved_counts[i] * config->rad_per_count / config->period_s;
        const omni_real_t error = state->wheel_reference[i] - speed;
        const omni_real_t integral = windowed_sum(state->wheel_window[i], state->next, error);
        state->voltage_V[i] = config->motor_p * error + config->motor_i * integral;
    }
    (void)omni_saturate_direction(state->voltage_V, wheels, supply_V);
}

void omni_original_step(omni_original_state_t *state, const omni_original_config_t *config, const omni_kinematics_t *k,
                        const omni_int_t *delta_counts, const omni_pose_t *pose, const omni_pose_t *reference,
                        const omni_twist_t *reference_rate, omni_real_t supply_V) {
    OMNI_INVARIANT(state->next < OMNI_ORIGINAL_WINDOW && state->tick < config->period_ticks);
    for (uint8_t i = 0; i < k->wheels; i++) {
        state->moved_counts[i] += delta_counts[i];
    }
    state->tick++;
    if (state->tick < config->period_ticks) {
        return;
    }
    state->tick = 0;
    if (!omni_pose_is_finite(pose) || !omni_motion_is_finite(reference, reference_rate)) {
        omni_original_reset(state);
        return;
    }
    const omni_twist_t world = position_law(state, config, pose, reference, reference_rate);
    const omni_twist_t body = omni_twist_to_body(&world, pose->theta);
    omni_kinematics_inverse(k, &body, NULL, state->wheel_reference);
    (void)omni_saturate_direction(state->wheel_reference, k->wheels, config->wheel_limit);
    motor_law(state, config, k->wheels, supply_V);
    state->next = (uint8_t)((state->next + 1) % OMNI_ORIGINAL_WINDOW);
    memset(state->moved_counts, 0, sizeof state->moved_counts);
}
