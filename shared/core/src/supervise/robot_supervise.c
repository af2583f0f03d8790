/* SPDX-License-Identifier: MIT */
#include "../tick/stages.h"

#include <string.h>

#include "../math/invariant.h"
#include "../math/math_inline.h"

static const omni_real_t BRAKING = 5.0f;  /* longest braking time in units of stall_s */
static const omni_real_t ROUNDING = 0.5f; /* encoder quantisation, counts */

/* Is a wheel that turns against its voltage being braked? Then the voltage has just changed its sign or become large,
 * and the wheel slows down at least linearly to rest within BRAKING times stall_s (a heavy robot with weak motors needs
 * about a second). A wheel with a reversed encoder does not slow down. */
static omni_flag_t update_braking(omni_stall_watch_t *watch, const omni_robot_config_t *c, omni_flag_t judged) {
    const omni_flag_t back = judged & (watch->counts < 0.0f);
    const omni_real_t time_s = c->step_s * watch->ticks;
    const omni_flag_t begins = back & (watch->braked_s < 0.0f) & (time_s <= c->limits.stall_s);
    const omni_flag_t goes_on = back & (watch->braked_s > 0.0f);
    const omni_real_t rate = (ROUNDING - watch->counts) / omni_maxf(watch->ticks, 1.0f);
    watch->rate = omni_select(begins, omni_maxf(rate, watch->rate), watch->rate);
    const omni_real_t left = 1.0f - watch->braked_s / (BRAKING * c->limits.stall_s);
    const omni_flag_t slows = goes_on & (-watch->counts <= watch->rate * left * watch->ticks);
    watch->braked_s = omni_select(begins, time_s, omni_select(goes_on, watch->braked_s + time_s, watch->braked_s));
    return begins | slows;
}

/* A wheel that has stopped or turns with its voltage is not braked until the voltage changes its sign again. */
static void end_braking(omni_stall_watch_t *watch, omni_flag_t judged) {
    const omni_real_t rate = (watch->counts + ROUNDING) / omni_maxf(watch->ticks, 1.0f);
    watch->rate = omni_select(judged & (watch->counts > 0.0f), rate, watch->rate);
    watch->braked_s = omni_select(judged & (watch->counts >= 0.0f), 0.0f, watch->braked_s);
}

/* Restart the measurement: the voltage has become large or changed its sign, so earlier counts are not comparable. */
static void restart_stall_measurement(omni_stall_watch_t *watch, omni_flag_t begins) {
    const omni_flag_t anew = begins & (watch->counts > 0.0f);
    watch->braked_s = omni_select(begins, -1.0f, watch->braked_s);
    watch->ticks = omni_select(anew, 0.0f, watch->ticks);
    watch->expected_volt_ticks = omni_select(anew, 0.0f, watch->expected_volt_ticks);
    watch->counts = omni_select(anew, 0.0f, watch->counts);
}

/* Stall check: a wheel under voltage must turn in its direction, by the encoder (the filter's speed depends on the
 * motor model). It is checked when a wheel at a tenth of the voltage's no-load speed would have given a count; earlier,
 * a slow wheel between two counts would look stalled. stalled_s grows with real time for a blocked wheel, twice as fast
 * for a reversed one unless it is braked, and falls for one that is faster than that tenth. */
static omni_uint_t check_stall(omni_stall_watch_t *watch, const omni_robot_config_t *c, omni_flag_t judged) {
    omni_uint_t faults = 0;
    const omni_real_t behind = watch->expected_volt_ticks - watch->counts * c->limits.volt_ticks_per_count_V;
    if (omni_any(behind > 0.0f) || omni_any(watch->stalled_s > 0.0f)) {
        const omni_real_t share =
            omni_select(update_braking(watch, c, judged), 0.0f, behind / watch->expected_volt_ticks);
        const omni_real_t longer_s = watch->stalled_s + c->step_s * watch->ticks * omni_minf(share, 2.0f);
        const omni_real_t stalled_s = omni_maxf(longer_s, 0.0f);
        watch->stalled_s = omni_select(judged, stalled_s, watch->stalled_s);
        if (watch->stalled_s > c->limits.stall_s) {
            faults |= OMNI_FAULT_STALL;
        }
    }
    end_braking(watch, judged);
    watch->ticks = omni_select(judged, 0.0f, watch->ticks);
    watch->expected_volt_ticks = omni_select(judged, 0.0f, watch->expected_volt_ticks);
    watch->counts = omni_select(judged, 0.0f, watch->counts);
    return faults;
}

static omni_uint_t supervise_stall(omni_stall_watch_t *watch, const omni_robot_config_t *c,
                                   const omni_estimate_t *estimate, const omni_real_t *applied_V) {
    const omni_real_t steps = (omni_real_t)estimate->steps;
    const omni_real_t stall_V = c->limits.stall_V;
    const omni_real_t volt_ticks_per_count_V = c->limits.volt_ticks_per_count_V;
    const uint8_t wheels = c->kinematics.wheels;
    omni_uint_t faults = 0;
    for (uint8_t i = 0; i < wheels; ++i, ++watch) {
        const omni_real_t volts = omni_absf(applied_V[i]);
        const omni_flag_t pushed = volts >= stall_V;
        if (!omni_any(pushed)) {
            if (omni_any(watch->last_V != 0.0f)) { /* usually already cleared */
                memset(watch, 0, sizeof *watch);
            }
            continue;
        }
        const omni_flag_t begins = pushed & (watch->last_V * applied_V[i] <= 0.0f);
        if (omni_any(begins)) {
            restart_stall_measurement(watch, begins);
        }
        watch->last_V = omni_select(pushed, applied_V[i], 0.0f);
        const omni_real_t delta = (omni_real_t)estimate->delta_counts[i];
        const omni_real_t onward = omni_select(applied_V[i] < 0.0f, -delta, delta);
        watch->stalled_s = omni_select(pushed, watch->stalled_s, 0.0f);
        watch->ticks = omni_select(pushed, watch->ticks + steps, 0.0f);
        watch->expected_volt_ticks = omni_select(pushed, watch->expected_volt_ticks + volts * steps, 0.0f);
        watch->counts = omni_select(pushed, watch->counts + onward, 0.0f);
        watch->braked_s = omni_select(pushed, watch->braked_s, 0.0f);
        watch->rate = omni_select(pushed, watch->rate, 0.0f);
        const omni_flag_t judged = watch->expected_volt_ticks >= volt_ticks_per_count_V;
        if (omni_any(judged)) {
            faults |= check_stall(watch, c, judged);
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
    return omni_motion_is_finite(&setpoint->pose, &setpoint->twist) && omni_all_finite(setpoint->duty, OMNI_MAX_WHEELS);
}

static bool is_beyond(const omni_limits_t *limits, const omni_pose_t *pose) {
    return omni_absf(pose->x) > limits->position_m || omni_absf(pose->y) > limits->position_m;
}

static bool is_streamed(uint8_t kind) {
    return kind == OMNI_SETPOINT_POSE || kind == OMNI_SETPOINT_VELOCITY_BODY || kind == OMNI_SETPOINT_VELOCITY_WORLD ||
           kind == OMNI_SETPOINT_DUTY;
}

/* Distance of the reference from a pose setpoint at which the drive to it has ended. */
static const omni_real_t ARRIVED_M = 0.005f;
static const omni_real_t ARRIVED_RAD = 0.02f;

static bool is_at_setpoint(const omni_pose_t *reference, const omni_pose_t *setpoint) {
    return omni_absf(setpoint->x - reference->x) < ARRIVED_M && omni_absf(setpoint->y - reference->y) < ARRIVED_M &&
           omni_absf(omni_wrap_pi(setpoint->theta - reference->theta)) < ARRIVED_RAD;
}

/* A stream that ends at rest: velocity or duties of zero, or a pose that stands still and that the reference has
 * reached. Only a setpoint that moves the robot can be lost. */
static bool asks_for_rest(const omni_setpoint_t *setpoint, const omni_pose_t *reference) {
    const omni_twist_t *twist = &setpoint->twist;
    const bool still = omni_absf(twist->vx) + omni_absf(twist->vy) + omni_absf(twist->wz) <= 0.0f;
    switch (setpoint->kind) {
    case OMNI_SETPOINT_POSE:
        return still && is_at_setpoint(reference, &setpoint->pose);
    case OMNI_SETPOINT_VELOCITY_BODY:
    case OMNI_SETPOINT_VELOCITY_WORLD:
        return still;
    case OMNI_SETPOINT_DUTY: {
        omni_real_t sum = 0.0f;
        for (uint32_t i = 0; i < OMNI_MAX_WHEELS; i++) {
            sum += omni_absf(setpoint->duty[i]);
        }
        return sum <= 0.0f;
    }
    default:
        return false;
    }
}

/* Select the setpoint. A streamed one that has timed out since arming is a fault unless it asks for rest; one from
 * before arming is ignored. */
static omni_uint_t supervise_setpoint(const omni_supervisor_t *supervisor, const omni_limits_t *limits,
                                      const omni_inputs_t *inputs, const omni_pose_t *reference, uint8_t *kind) {
    const omni_setpoint_t *setpoint = &inputs->setpoint;
    *kind = OMNI_SETPOINT_NONE;
    if (!setpoint_is_finite(setpoint) || setpoint->kind > OMNI_SETPOINT_DUTY) {
        return OMNI_FAULT_NOT_FINITE;
    }
    if (is_streamed(setpoint->kind) &&
        omni_robot_age_s(inputs->time_us, setpoint->time_us) > limits->command_timeout_s) {
        if (supervisor->state != OMNI_STATE_ARMED || setpoint->time_us < supervisor->armed_since_us) {
            return 0;
        }
        if (!asks_for_rest(setpoint, reference)) {
            return OMNI_FAULT_COMMAND_LOSS;
        }
    }
    if (setpoint->kind == OMNI_SETPOINT_POSE && is_beyond(limits, &setpoint->pose)) {
        return OMNI_WARN_SETPOINT;
    }
    *kind = setpoint->kind;
    return 0;
}

omni_uint_t omni_robot_supervise(omni_supervisor_t *supervisor, const omni_robot_config_t *config,
                                 const omni_inputs_t *inputs, const omni_estimate_t *estimate,
                                 const omni_pose_t *reference, const omni_applied_t *last, uint8_t *kind) {
    omni_uint_t faults = inputs->faults & (uint32_t)OMNI_FAULT_STOP_MASK;
    if (!omni_motion_is_finite(&estimate->pose, &estimate->rate)) {
        faults |= OMNI_FAULT_NOT_FINITE;
    }
    if (is_beyond(&config->limits, &estimate->pose)) {
        faults |= OMNI_FAULT_POSITION;
    }
    faults |= supervise_stall(supervisor->stall, config, estimate, last->voltage_V);
    if (config->current.enabled) {
        faults |= omni_robot_watch_currents(supervisor, config, estimate, last);
    }
    faults |= supervise_supply(&supervisor->battery_ticks, &config->limits, inputs, estimate->supply_V);
    faults |= supervise_link(&config->limits, inputs);
    faults |= supervise_setpoint(supervisor, &config->limits, inputs, reference, kind);
    faults |= omni_select(last->saturated, (uint32_t)OMNI_WARN_SATURATED, 0u);
    faults |= omni_select(supervisor->speeds.armed, supervisor->speeds.overspeed_fault, 0u);
    if (last->tracking_error_exceeded) {
        faults |= OMNI_FAULT_TRACKING;
    }
    return faults;
}

static void apply_safety_event(omni_supervisor_t *supervisor, omni_safety_event_t event) {
    OMNI_INVARIANT(supervisor->state < OMNI_STATE_COUNT);
    const bool armed = supervisor->state == OMNI_STATE_ARMED;
    supervisor->state = omni_safety_next(supervisor->state, event);
    if (armed != (supervisor->state == OMNI_STATE_ARMED)) {
        supervisor->speeds.ticks_left = 0; /* check the speeds in this tick */
    }
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
    const omni_uint_t arming_faults = faults | supervisor->speeds.overspeed_fault; /* a turning wheel prevents arming */
    if ((events & OMNI_EVENT_ARM) != 0 && (arming_faults & (uint32_t)OMNI_FAULT_STOP_MASK) == 0) {
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
