/* SPDX-License-Identifier: MIT */
#include "robot_internal.h"

#include "../math/invariant.h"
#include "../math/math_inline.h"

/* A wheel under voltage must turn, and the way it is driven. What counts is the encoder itself, not the filter, which
 * believes its motor model too. A wheel that turns at a tenth of what the voltage gives is let through. One that stands
 * still uses up stall_s as time goes by. One that turns the other way does so at most twice as
 * fast; a reversal of the voltage is legal. */
static omni_uint_t supervise_wheels(omni_real_t *stalled_s, const omni_robot_config_t *c,
                                    const omni_estimate_t *estimate, const omni_real_t *applied_V) {
    const omni_real_t tenth_per_V = 0.1f / c->speed_gain_V_s;
    omni_uint_t faults = 0;
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        const omni_real_t voltage = applied_V[i];
        const omni_flag_t pushed = omni_absf(voltage) >= c->limits.stall_V;
        if (!omni_any(pushed)) {
            stalled_s[i] = 0.0f;
            continue;
        }
        const omni_real_t elapsed = c->step_s * (omni_real_t)estimate->steps;
        const omni_real_t enough = omni_absf(voltage) * tenth_per_V * elapsed;
        const omni_real_t moved = (omni_real_t)estimate->delta_counts[i] * c->rad_per_count * omni_signf(voltage);
        const omni_real_t missing = omni_clampf(1.0f - moved / enough, -2.0f, 2.0f);
        const omni_real_t longer_s = omni_clampf(stalled_s[i] + elapsed * missing, 0.0f, 2.0f * c->limits.stall_s);
        stalled_s[i] = omni_select(pushed, longer_s, 0.0f);
        if (stalled_s[i] > c->limits.stall_s) {
            faults |= OMNI_FAULT_STALL;
        }
    }
    return faults;
}

static omni_uint_t supervise_supply(uint32_t *battery_ticks, const omni_limits_t *limits, const omni_inputs_t *inputs,
                                    omni_real_t supply_V) {
    omni_uint_t faults = 0;
    *battery_ticks = supply_V < limits->battery_min_V ? *battery_ticks + 1 : 0;
    if (*battery_ticks >= OMNI_BATTERY_TICKS) {
        faults |= OMNI_FAULT_BATTERY;
    }
    if (inputs->driver_failures >= limits->driver_failures) {
        faults |= OMNI_FAULT_DRIVER;
    }
    return faults;
}

static omni_uint_t supervise_link(const omni_limits_t *limits, const omni_inputs_t *inputs) {
    const bool silent =
        inputs->heartbeat_us == 0 || omni_robot_age_s(inputs->time_us, inputs->heartbeat_us) > limits->link_timeout_s;
    return silent ? (omni_uint_t)OMNI_FAULT_LINK_LOSS : (omni_uint_t)0u;
}

static bool setpoint_is_finite(const omni_setpoint_t *setpoint) {
    return omni_pose_is_finite(&setpoint->pose) && omni_twist_is_finite(&setpoint->twist) &&
           omni_all_finite(setpoint->duty, OMNI_MAX_WHEELS);
}

static bool is_beyond(const omni_limits_t *limits, const omni_pose_t *pose) {
    return omni_absf(pose->x) > limits->position_m || omni_absf(pose->y) > limits->position_m;
}

static bool is_streamed(uint8_t kind) {
    return kind == OMNI_SETPOINT_POSE || kind == OMNI_SETPOINT_VELOCITY_BODY || kind == OMNI_SETPOINT_VELOCITY_WORLD ||
           kind == OMNI_SETPOINT_DUTY;
}

/* The set-point in force. A streamed one that has gone silent since arming is a fault; one from before is ignored. */
static omni_uint_t supervise_setpoint(const omni_supervisor_t *supervisor, const omni_limits_t *limits,
                                      const omni_inputs_t *inputs, uint8_t *kind) {
    const omni_setpoint_t *setpoint = &inputs->setpoint;
    *kind = OMNI_SETPOINT_NONE;
    if (!setpoint_is_finite(setpoint) || setpoint->kind > OMNI_SETPOINT_DUTY) {
        return OMNI_FAULT_NOT_FINITE;
    }
    if (is_streamed(setpoint->kind) &&
        omni_robot_age_s(inputs->time_us, setpoint->time_us) > limits->command_timeout_s) {
        const bool lost = supervisor->state == OMNI_STATE_ARMED && setpoint->time_us >= supervisor->armed_since_us;
        return lost ? (omni_uint_t)OMNI_FAULT_COMMAND_LOSS : (omni_uint_t)0u;
    }
    if (setpoint->kind == OMNI_SETPOINT_POSE && is_beyond(limits, &setpoint->pose)) {
        return OMNI_WARN_SETPOINT;
    }
    *kind = setpoint->kind;
    return 0;
}

omni_uint_t omni_robot_supervise(omni_supervisor_t *supervisor, const omni_robot_config_t *config,
                                 const omni_inputs_t *inputs, const omni_estimate_t *estimate,
                                 const omni_applied_t *last, uint8_t *kind) {
    omni_uint_t faults = inputs->faults & (uint32_t)OMNI_FAULT_STOP_MASK;
    if (!omni_pose_is_finite(&estimate->pose) || !omni_twist_is_finite(&estimate->rate)) {
        faults |= OMNI_FAULT_NOT_FINITE;
    }
    if (is_beyond(&config->limits, &estimate->pose)) {
        faults |= OMNI_FAULT_POSITION;
    }
    faults |= supervise_wheels(supervisor->stalled_s, config, estimate, last->voltage_V);
    faults |= supervise_supply(&supervisor->battery_ticks, &config->limits, inputs, estimate->supply_V);
    faults |= supervise_link(&config->limits, inputs);
    faults |= supervise_setpoint(supervisor, &config->limits, inputs, kind);
    faults |= omni_select(last->saturated, (uint32_t)OMNI_WARN_SATURATED, 0u);
    if (last->off_track) {
        faults |= OMNI_FAULT_TRACKING;
    }
    return faults;
}

static void apply_safety_event(omni_supervisor_t *supervisor, omni_safety_event_t event) {
    OMNI_INVARIANT(supervisor->state < OMNI_STATE_COUNT);
    supervisor->state = omni_safety_next(supervisor->state, event);
}

void omni_robot_stop(omni_supervisor_t *supervisor, uint32_t fault) {
    supervisor->fault_history |= fault;
    apply_safety_event(supervisor, OMNI_SAFETY_FAULT);
}

bool omni_robot_transition(omni_supervisor_t *supervisor, const omni_inputs_t *inputs, omni_uint_t faults) {
    const uint32_t events = inputs->events;
    const omni_safety_state_t before = supervisor->state;
    if (supervisor->state == OMNI_STATE_INIT) {
        apply_safety_event(supervisor, OMNI_SAFETY_READY);
    }
    if ((events & OMNI_EVENT_ESTOP_CLEAR) != 0) {
        apply_safety_event(supervisor, OMNI_SAFETY_ESTOP_CLEAR);
    }
    if ((events & OMNI_EVENT_ARM) != 0 && (faults & (uint32_t)OMNI_FAULT_STOP_MASK) == 0) {
        apply_safety_event(supervisor, OMNI_SAFETY_ARM);
    }
    const bool armed = supervisor->state == OMNI_STATE_ARMED && before != OMNI_STATE_ARMED;
    if (armed) {
        supervisor->armed_since_us = inputs->time_us;
        supervisor->fault_history = 0;
    }
    if ((events & OMNI_EVENT_DISARM) != 0) {
        apply_safety_event(supervisor, OMNI_SAFETY_DISARM);
    }
    if ((faults & (uint32_t)OMNI_FAULT_STOP_MASK) != 0) {
        if (supervisor->state == OMNI_STATE_ARMED) {
            supervisor->fault_history |= (uint32_t)(faults & (uint32_t)OMNI_FAULT_STOP_MASK);
        }
        apply_safety_event(supervisor, OMNI_SAFETY_FAULT);
    }
    if ((events & OMNI_EVENT_ESTOP) != 0) {
        apply_safety_event(supervisor, OMNI_SAFETY_ESTOP);
    }
    return armed;
}
