/* SPDX-License-Identifier: MIT */
#include "omni/robot.h"

#include <string.h>

#include "../estimate/pose_ekf_inline.h"
#include "../math/invariant.h"
#include "../math/math_inline.h"
#include "omni/kinematics.h"
#include "stages.h"

void omni_robot_init(omni_robot_t *robot, const omni_robot_config_t *config) {
    const omni_pose_t origin = {0.0f, 0.0f, 0.0f};
    memset(robot, 0, sizeof *robot);
    robot->config = config;
    robot->supervisor.state = OMNI_STATE_INIT;
    robot->supervisor.speeds.armed = true; /* so that the first tick starts the overspeed check with its counts */
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        omni_motor_kf_reset(&robot->estimator.motor_kf[i], &config->motor_kf);
    }
    omni_pose_ekf_set_pose(&robot->estimator.pose_ekf, &config->pose_ekf, &origin, 0);
    omni_robot_control_reset(&robot->control);
    robot->control.last_controller = config->controller;
}

void omni_robot_set_config(omni_robot_t *robot, const omni_robot_config_t *config) {
    robot->config = config;
    for (int i = config->kinematics.wheels; i < OMNI_MAX_WHEELS; ++i) { /* a wheel that does not exist has no current */
        omni_motor_kf_reset(&robot->estimator.motor_kf[i], &config->motor_kf);
    }
    if (!config->current.enabled) { /* the estimate would become stale */
        memset(&robot->supervisor.current, 0, sizeof robot->supervisor.current);
        robot->applied.current_reduction = 0.0f;
    }
}

/* Did this wheel cause one of the faults? */
static bool fault_involves_wheel(const omni_robot_t *robot, omni_uint_t faults, uint8_t wheel) {
    const bool blind = (faults & (uint32_t)OMNI_FAULT_ENCODER) != 0 &&
                       robot->estimator.missing_count_ticks[wheel] >= (uint32_t)OMNI_ENCODER_TICKS;
    const bool stalled = (faults & (uint32_t)OMNI_FAULT_STALL) != 0 &&
                         robot->supervisor.stall[wheel].stalled_s > robot->config->limits.stall_s;
    const bool hot = (faults & (uint32_t)OMNI_FAULT_MOTOR_HEAT) != 0 && robot->supervisor.current.heat[wheel] >= 1.0f;
    const bool fast = (faults & (uint32_t)OMNI_FAULT_OVERSPEED) != 0 &&
                      robot->supervisor.speeds.overspeed_checks[wheel] > (omni_real_t)OMNI_OVERSPEED_CHECKS;
    return blind || stalled || hot || fast;
}

/* Speed of a wheel by its encoder, or by the filter if counts are missing. */
static omni_real_t stop_speed(const omni_robot_t *robot, const omni_estimate_t *estimate, uint8_t wheel)
    __attribute__((noinline, cold));

static omni_real_t stop_speed(const omni_robot_t *robot, const omni_estimate_t *estimate, uint8_t wheel) {
    if (robot->estimator.missing_count_ticks[wheel] > 0) {
        return estimate->wheel_rad_s[wheel];
    }
    const omni_real_t ticks = (omni_real_t)(estimate->steps > 0 ? estimate->steps : 1u);
    return (omni_real_t)estimate->delta_counts[wheel] * robot->config->rad_per_count / (robot->config->step_s * ticks);
}

/* Record the snapshot of a stop fault. Once per stop, so optimised for size. */
static void record_stop_cause(omni_robot_t *robot, omni_uint_t faults, const omni_estimate_t *estimate)
    __attribute__((noinline, cold));

static void record_stop_cause(omni_robot_t *robot, omni_uint_t faults, const omni_estimate_t *estimate) {
    omni_stop_t *stop = &robot->supervisor.stop;
    memset(stop, 0, sizeof *stop);
    stop->supply_V = estimate->supply_V;
    if (robot->control.tracking) {
        memcpy(stop->error, robot->control.demand.terms.error, sizeof stop->error);
    }
    for (uint8_t i = 0; i < robot->config->kinematics.wheels; ++i) {
        if (stop->wheel == 0 && fault_involves_wheel(robot, faults, i)) {
            stop->wheel = (uint8_t)(i + 1);
            stop->voltage_V = robot->applied.voltage_V[i];
            stop->current_A = robot->supervisor.current.current_A[i];
            stop->wheel_rad_s = stop_speed(robot, estimate, i);
        }
    }
}

/* Apply the events of this tick: pose, trajectory, safety state. */
static void apply_events(omni_robot_t *robot, const omni_inputs_t *inputs, omni_uint_t faults,
                         omni_estimate_t *estimate) {
    if ((inputs->events & OMNI_EVENT_SET_POSE) != 0 && robot->supervisor.state != OMNI_STATE_ARMED &&
        omni_pose_is_finite(&inputs->pose)) {
        omni_robot_set_pose(&robot->estimator, robot->config, inputs, estimate);
    }
    omni_robot_reference_events(&robot->reference_generator, inputs, estimate);
    const bool drove = robot->supervisor.state == OMNI_STATE_ARMED;
    if (omni_robot_transition(&robot->supervisor, inputs, faults)) {
        omni_robot_reference_arm(&robot->reference_generator, inputs, estimate);
        omni_robot_control_reset(&robot->control);
        memset(&robot->supervisor.stop, 0, sizeof robot->supervisor.stop);
    }
    if (drove && robot->supervisor.state == OMNI_STATE_FAILSAFE) {
        record_stop_cause(robot, faults, estimate);
    }
}

/* Final gate: duties that are not finite, or of a robot that is not armed, are 0. @return OMNI_FAULT_NOT_FINITE or 0.
 */
static omni_uint_t gate_actuation(omni_supervisor_t *supervisor, omni_real_t supply_V, omni_applied_t *applied,
                                  omni_actuation_t *actuation) {
    const bool finite = omni_all_finite(actuation->duty, OMNI_MAX_WHEELS);
    if (!finite) {
        omni_robot_stop(supervisor, OMNI_FAULT_NOT_FINITE);
    }
    actuation->drive = finite && supervisor->state == OMNI_STATE_ARMED;
    /*@ split actuation->drive; */
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        actuation->duty[i] = actuation->drive ? omni_clampf(actuation->duty[i], -1.0f, 1.0f) : 0.0f;
        applied->voltage_V[i] = actuation->duty[i] * supply_V;
        OMNI_INVARIANT(omni_all(omni_absf(actuation->duty[i]) <= 1.0f));
    }
    OMNI_INVARIANT(!actuation->drive || supervisor->state == OMNI_STATE_ARMED);
    return finite ? (omni_uint_t)0u : (omni_uint_t)OMNI_FAULT_NOT_FINITE;
}

static void report_gyro(const omni_estimator_t *estimator, omni_outputs_t *outputs) {
    const omni_ekf_gyro_rate_t *turn = &estimator->gyro.turn;
    const bool used = turn->overrides_wheels || turn->at_rest;
    const omni_real_t bias = omni_pose_ekf_bias(&estimator->pose_ekf);
    outputs->gyro_bias = bias;
    outputs->gyro_bias_sd = omni_sqrtf(omni_pose_ekf_bias_variance(&estimator->pose_ekf));
    outputs->gyro_rad_s = used ? turn->rate_rad_s - bias : 0.0f;
    outputs->gyro_used = used;
}

static void report_flow(const omni_flow_state_t *flow, omni_outputs_t *outputs) {
    memcpy(outputs->flow_sum, flow->sum, sizeof outputs->flow_sum);
    outputs->flow_nis = flow->nis;
    outputs->flow_used = flow->readings_used;
    outputs->flow_refused = flow->readings_rejected;
    outputs->flow_received = flow->received;
    outputs->flow_dropped = flow->dropped;
    outputs->flow_misalignment_rad = flow->misalignment_rad;
    outputs->flow_usable = !flow->faulty && !flow->timed_out;
    outputs->flow_overriding = flow->overriding;
}

static void report_estimate(const omni_estimator_t *estimator, const omni_robot_config_t *config,
                            const omni_estimate_t *estimate, omni_outputs_t *outputs) {
    if (config->motor_kf.mode == OMNI_KF_MODE_OFF) {
        memset(outputs->current_A, 0, sizeof outputs->current_A);
    } else {
        for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
            outputs->current_A[i] = estimator->motor_kf[i].x[2];
        }
    }
    memcpy(outputs->wheel_rad_s, estimate->wheel_rad_s, sizeof outputs->wheel_rad_s);
    memcpy(outputs->slip_m_s, estimate->slip_m_s, sizeof outputs->slip_m_s);
    outputs->slip_residual_m_s = omni_kinematics_slip_residual(&config->kinematics, estimate->wheel_rad_s);
    outputs->supply_V = estimate->supply_V;
    outputs->pose = estimate->pose;
    outputs->rate = estimate->rate;
    for (int axis = 0; axis < OMNI_AXES; ++axis) {
        outputs->pose_sd[axis] = omni_sqrtf(omni_pose_ekf_variance(&estimator->pose_ekf, axis));
    }
    outputs->pose_xy_m2 = estimator->pose_ekf.p[0][1];
    outputs->nis = estimate->nis;
    outputs->fixes_accepted = estimate->fixes_accepted;
    outputs->fixes_refused = estimate->fixes_refused;
    if (config->gyro.axis != 0) {
        report_gyro(estimator, outputs);
    } else {
        outputs->gyro_rad_s = 0.0f;
        outputs->gyro_bias = 0.0f;
        outputs->gyro_bias_sd = 0.0f;
        outputs->gyro_used = false;
    }
    if (config->flow.axes != 0) {
        report_flow(&estimator->flow, outputs);
    } else {
        memset(outputs->flow_sum, 0, sizeof outputs->flow_sum);
        outputs->flow_nis = 0.0f;
        outputs->flow_used = 0u;
        outputs->flow_refused = 0u;
        outputs->flow_received = 0u;
        outputs->flow_dropped = 0u;
        outputs->flow_misalignment_rad = 0.0f;
        outputs->flow_usable = false;
        outputs->flow_overriding = false;
    }
}

static void report_control(const omni_robot_t *robot, const omni_target_t *target, const omni_actuation_t *actuation,
                           omni_outputs_t *outputs) {
    outputs->drive = actuation->drive;
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        const omni_real_t duty = actuation->duty[i];
        outputs->duty[i] = robot->config->motor_direction[i] < 0 ? -duty : duty;
    }
    memcpy(outputs->voltage_V, robot->applied.voltage_V, sizeof outputs->voltage_V);
    memcpy(outputs->wheel_reference, actuation->wheel_reference, sizeof outputs->wheel_reference);
    outputs->wheel_scale = actuation->wheel_scale;
    outputs->duty_scale = actuation->duty_scale;
    outputs->velocity_scale = target->velocity_scale;
    outputs->velocity_limits = target->velocity_limits;
    outputs->stop = robot->supervisor.stop;
    outputs->reference = target->reference;
    outputs->setpoint_kind = target->kind;
    if (target->position_loop) {
        outputs->terms = robot->control.demand.terms;
    } else {
        memset(&outputs->terms, 0, sizeof outputs->terms);
    }
}

/* Stages after the safety state: reference, control, limits, report. */
static void drive_and_report(omni_robot_t *robot, const omni_inputs_t *inputs, const omni_estimate_t *estimate,
                             uint8_t kind, omni_uint_t faults, omni_outputs_t *outputs)
    /* Not inlined, so that its frame is not on the stack during the pose filter, the deepest call of the tick. */
    __attribute__((noinline));

/* Count down to the next overspeed check and keep the peak of each wheel's reference; the check itself is a rare call.
 */
static inline __attribute__((always_inline)) void check_overspeed_when_due(omni_robot_t *robot,
                                                                           const omni_estimate_t *estimate,
                                                                           const omni_target_t *target,
                                                                           const omni_actuation_t *actuation) {
    omni_speed_watch_t *speeds = &robot->supervisor.speeds;
    if (speeds->ticks_left > estimate->steps) {
        const uint32_t wheel = speeds->ticks_left %
                               (4 * OMNI_MAX_WHEELS); /* one wheel per tick, in a quarter of the ticks, to save time */
        if (wheel < OMNI_MAX_WHEELS) {
            const omni_real_t reference = omni_absf(actuation->wheel_reference[wheel]);
            const omni_real_t peak = speeds->peak_reference_rad_s[wheel];
            speeds->peak_reference_rad_s[wheel] = omni_maxf(reference, peak);
        }
        speeds->ticks_left -= estimate->steps;
    } else {
        omni_robot_watch_speeds(speeds, robot->config, &robot->estimator, estimate, target, actuation);
    }
}

static void drive_and_report(omni_robot_t *robot, const omni_inputs_t *inputs, const omni_estimate_t *estimate,
                             uint8_t kind, omni_uint_t faults, omni_outputs_t *outputs) {
    const omni_robot_config_t *config = robot->config;
    omni_target_t target;
    omni_actuation_t actuation;
    target.armed = robot->supervisor.state == OMNI_STATE_ARMED;
    omni_robot_reference(&robot->reference_generator, config, inputs, estimate, kind, &target);
    target.excitation =
        robot->excitation.ticks_left == 0 ? NULL : omni_robot_excite(&robot->excitation, config, inputs, &target);
    OMNI_INVARIANT(target.armed || (!target.position_loop && target.kind == OMNI_SETPOINT_NONE));
    omni_robot_control(&robot->control, config, inputs, estimate, &target, &robot->applied, &actuation);
    if (config->current.enabled) {
        robot->applied.current_reduction = 0.0f;
        if (config->current.limit_enabled && target.armed) {
            omni_robot_limit_currents(&robot->control, config, &robot->supervisor.current, estimate->supply_V,
                                      &robot->applied, &actuation);
        }
    }
    check_overspeed_when_due(robot, estimate, &target, &actuation);
    faults |= omni_robot_gain_margin(&robot->margin, config, &robot->estimator.pose_ekf, estimate, &target);
    faults |= gate_actuation(&robot->supervisor, estimate->supply_V, &robot->applied, &actuation);
    robot->supervisor.faults = faults;
    report_estimate(&robot->estimator, config, estimate, outputs);
    report_control(robot, &target, &actuation, outputs);
    memcpy(outputs->ismc_margin, robot->margin.margin, sizeof outputs->ismc_margin);
    memset(outputs->motor_heat, 0, sizeof outputs->motor_heat);
    outputs->current_reduction = 0.0f;
    if (config->current.enabled) {
        omni_robot_report_currents(&robot->supervisor.current, &robot->applied, outputs);
    }
    outputs->time_us = inputs->time_us;
    outputs->state = (uint8_t)robot->supervisor.state;
    outputs->controller = config->controller;
    outputs->faults = robot->supervisor.faults;
    outputs->fault_history = robot->supervisor.fault_history;
    outputs->config_sequence = config->sequence;
}

void omni_robot_tick(omni_robot_t *robot, const omni_inputs_t *inputs, omni_outputs_t *outputs) {
    omni_estimate_t estimate;
    uint8_t kind;
    omni_uint_t faults = omni_robot_estimate(&robot->estimator, robot->config, inputs, &robot->applied, &estimate);
    faults |= omni_robot_supervise(&robot->supervisor, robot->config, inputs, &estimate,
                                   &robot->reference_generator.reference_pose, &robot->applied, &kind);
    apply_events(robot, inputs, faults, &estimate);
    drive_and_report(robot, inputs, &estimate, kind, faults, outputs);
    omni_robot_restart_filters(&robot->estimator, robot->config, &estimate);
}

uint32_t omni_robot_arming_faults(const omni_robot_t *robot) {
    const omni_uint_t now = robot->supervisor.faults | robot->supervisor.speeds.overspeed_fault;
    const uint32_t faults = (uint32_t)(now & (uint32_t)OMNI_FAULT_STOP_MASK);
    return robot->supervisor.state == OMNI_STATE_DISARMED ? faults : faults | (uint32_t)OMNI_FAULT_CONFIG;
}
