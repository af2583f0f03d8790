/* SPDX-License-Identifier: MIT */
/* Motor currents in the tick. Not inlined: a robot without a current limit pays one branch only. */
#include <string.h>

#include "../control/pid_inline.h"
#include "../tick/stages.h"

omni_uint_t omni_robot_watch_currents(omni_supervisor_t *supervisor, const omni_robot_config_t *c,
                                      const omni_estimate_t *estimate, const omni_applied_t *last) {
    omni_current_state_t *state = &supervisor->current;
    const bool driven = supervisor->state == OMNI_STATE_ARMED;
    omni_current_estimate(state, &c->current, c->kinematics.wheels, last->voltage_V, estimate->wheel_rad_s,
                          estimate->delta_counts, driven, estimate->steps);
    omni_real_t most = 0.0f;
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        if (state->heat[i] > most) {
            most = state->heat[i];
        }
    }
    const bool warm = most > OMNI_HEAT_WARNING_FRACTION;
    state->overheated = most >= 1.0f || (state->overheated && warm);
    return (warm ? (uint32_t)OMNI_WARN_MOTOR_WARM : 0u) | (state->overheated ? (uint32_t)OMNI_FAULT_MOTOR_HEAT : 0u);
}

/* The wheel loops' anti-windup gets the limited voltages, as it does those of the duty limit. */
void omni_robot_limit_currents(omni_control_state_t *control, const omni_robot_config_t *c,
                               const omni_current_state_t *state, omni_real_t supply_V, omni_applied_t *applied,
                               omni_actuation_t *actuation) {
    const uint8_t wheels = c->kinematics.wheels;
    const omni_real_t most = c->wheel_speed.duty_limit;
    omni_real_t given_V[OMNI_MAX_WHEELS];
    for (uint8_t i = 0; i < wheels; ++i) {
        given_V[i] = actuation->duty[i] * supply_V;
    }
    const omni_real_t factor = omni_current_limit(&c->current, wheels, state->wheel_rad_s, given_V);
    const bool cut = factor < 1.0f;
    applied->current_reduction = 1.0f - factor;
    applied->saturated = applied->saturated || cut;
    if (factor >= 1.0f) {
        return;
    }
    for (uint8_t i = 0; i < wheels; ++i) {
        const omni_real_t wanted_V = actuation->duty[i] * supply_V;
        const omni_real_t applied_V = cut ? given_V[i] : wanted_V;
        if (cut) {
            actuation->duty[i] = omni_clampf(given_V[i] / supply_V, -most, most);
        }
        if (control->last_actuation_mode == OMNI_DEMAND_TWIST) {
            omni_pid_limited(&control->wheel_speed.pid[i], &c->wheel_speed.pid, wanted_V, applied_V);
        }
    }
}

void omni_robot_report_currents(const omni_current_state_t *state, const omni_applied_t *applied,
                                omni_outputs_t *outputs) {
    memcpy(outputs->current_A, state->current_A, sizeof outputs->current_A);
    memcpy(outputs->motor_heat, state->heat, sizeof outputs->motor_heat);
    outputs->current_reduction = applied->current_reduction;
}
