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
    robot->supervisor.speeds.armed = true; /* so that the first tick begins the watch, from its counts */
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        omni_motor_kf_reset(&robot->estimator.motor_kf[i], &config->motor_kf);
    }
    omni_pose_ekf_set_pose(&robot->estimator.pose_ekf, &config->pose_ekf, &origin, 0);
    omni_robot_control_reset(&robot->control);
    robot->control.last_controller = config->controller;
}

void omni_robot_set_config(omni_robot_t *robot, const omni_robot_config_t *config) {
    robot->config = config;
    for (int i = config->kinematics.wheels; i < OMNI_MAX_WHEELS; ++i) { /* a wheel that is not there has no current */
        omni_motor_kf_reset(&robot->estimator.motor_kf[i], &config->motor_kf);
    }
    if (!config->current.watched) { /* what was known of the currents gets old from now on */
        memset(&robot->supervisor.current, 0, sizeof robot->supervisor.current);
        robot->applied.current_cut = 0.0f;
    }
}

/* Does this fault come from this wheel? */
static bool is_to_blame(const omni_robot_t *robot, omni_uint_t faults, uint8_t wheel) {
    const bool blind = (faults & (uint32_t)OMNI_FAULT_ENCODER) != 0 &&
                       robot->estimator.encoder_ticks[wheel] >= (uint32_t)OMNI_ENCODER_TICKS;
    const bool stalled = (faults & (uint32_t)OMNI_FAULT_STALL) != 0 &&
                         robot->supervisor.stall[wheel].stalled_s > robot->config->limits.stall_s;
    const bool hot = (faults & (uint32_t)OMNI_FAULT_MOTOR_HEAT) != 0 && robot->supervisor.current.heat[wheel] >= 1.0f;
    const bool fast = (faults & (uint32_t)OMNI_FAULT_OVERSPEED) != 0 &&
                      robot->supervisor.speeds.looks[wheel] > (omni_real_t)OMNI_SPEED_LOOKS;
    return blind || stalled || hot || fast;
}

/* How fast a wheel turned: by its encoder, or by the filter if that gives no counts. */
static omni_real_t stop_speed(const omni_robot_t *robot, const omni_estimate_t *estimate, uint8_t wheel)
    __attribute__((noinline, cold));

static omni_real_t stop_speed(const omni_robot_t *robot, const omni_estimate_t *estimate, uint8_t wheel) {
    if (robot->estimator.encoder_ticks[wheel] > 0) {
        return estimate->wheel_rad_s[wheel];
    }
    const omni_real_t ticks = (omni_real_t)(estimate->steps > 0 ? estimate->steps : 1u);
    return (omni_real_t)estimate->delta_counts[wheel] * robot->config->rad_per_count / (robot->config->step_s * ticks);
}

/* A fault has just stopped the robot: keep what it saw. Once per stop, so small rather than fast. */
static void keep_stop(omni_robot_t *robot, omni_uint_t faults, const omni_estimate_t *estimate)
    __attribute__((noinline, cold));

static void keep_stop(omni_robot_t *robot, omni_uint_t faults, const omni_estimate_t *estimate) {
    omni_stop_t *stop = &robot->supervisor.stop;
    memset(stop, 0, sizeof *stop);
    stop->supply_V = estimate->supply_V;
    if (robot->control.tracking) {
        memcpy(stop->error, robot->control.demand.terms.error, sizeof stop->error);
    }
    for (uint8_t i = 0; i < robot->config->kinematics.wheels; ++i) {
        if (stop->wheel == 0 && is_to_blame(robot, faults, i)) {
            stop->wheel = (uint8_t)(i + 1);
            stop->voltage_V = robot->applied.voltage_V[i];
            stop->current_A = robot->supervisor.current.current_A[i];
            stop->wheel_rad_s = stop_speed(robot, estimate, i);
        }
    }
}

/* Events that move the estimate or the trajectory, and those that the safety table knows. */
static void apply_events(omni_robot_t *robot, const omni_inputs_t *inputs, omni_uint_t faults,
                         omni_estimate_t *estimate) {
    if ((inputs->events & OMNI_EVENT_SET_POSE) != 0 && robot->supervisor.state != OMNI_STATE_ARMED &&
        omni_pose_is_finite(&inputs->pose)) {
        omni_robot_set_pose(&robot->estimator, robot->config, inputs, estimate);
    }
    omni_robot_guide_events(&robot->guide, inputs, estimate);
    const bool drove = robot->supervisor.state == OMNI_STATE_ARMED;
    if (omni_robot_transition(&robot->supervisor, inputs, faults)) {
        omni_robot_guide_arm(&robot->guide, inputs, estimate);
        omni_robot_control_reset(&robot->control);
        memset(&robot->supervisor.stop, 0, sizeof robot->supervisor.stop);
    }
    if (drove && robot->supervisor.state == OMNI_STATE_FAILSAFE) {
        keep_stop(robot, faults, estimate);
    }
}

/* Last line of defence: what is not finite or not wanted never leaves the tick. @return what that says of the robot. */
static omni_uint_t seal_actuation(omni_supervisor_t *supervisor, omni_real_t supply_V, omni_applied_t *applied,
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
    const omni_ekf_turn_t *turn = &estimator->gyro.turn;
    const omni_flag_t used = turn->leads || turn->rest;
    const omni_real_t bias = omni_pose_ekf_bias(&estimator->pose_ekf);
    outputs->gyro_bias = bias;
    outputs->gyro_bias_sd = omni_sqrtf(omni_pose_ekf_bias_variance(&estimator->pose_ekf));
    outputs->gyro_rad_s = omni_select(used, turn->rate_rad_s - bias, 0.0f);
    outputs->gyro_used = used;
}

static void report_flow(const omni_flow_state_t *flow, omni_outputs_t *outputs) {
    memcpy(outputs->flow_sum, flow->sum, sizeof outputs->flow_sum);
    outputs->flow_nis = flow->nis;
    outputs->flow_used = flow->used;
    outputs->flow_refused = flow->refused;
    outputs->flow_came = flow->came;
    outputs->flow_lost = flow->lost;
    outputs->flow_off_rad = flow->off_rad;
    outputs->flow_usable = !flow->trouble && !flow->silent;
    outputs->flow_leads = flow->leads;
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
        outputs->flow_came = 0u;
        outputs->flow_lost = 0u;
        outputs->flow_off_rad = 0.0f;
        outputs->flow_usable = false;
        outputs->flow_leads = false;
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

/* From the safety state on: what is wanted, what the wheels are given, and what is told of it. */
static void drive_and_report(omni_robot_t *robot, const omni_inputs_t *inputs, const omni_estimate_t *estimate,
                             uint8_t kind, omni_uint_t faults, omni_outputs_t *outputs)
    /* Its frame is not to be on the stack while the pose filter has the deepest of the tick. */
    __attribute__((noinline));

/* Most ticks only count, or keep the peak of a wheel's reference: the watch itself is a call that is seldom made. */
static inline __attribute__((always_inline)) void watch_speeds_when_due(omni_robot_t *robot,
                                                                        const omni_estimate_t *estimate,
                                                                        const omni_target_t *target,
                                                                        const omni_actuation_t *actuation) {
    omni_speed_watch_t *speeds = &robot->supervisor.speeds;
    if (speeds->left > estimate->steps) {
        const uint32_t wheel = speeds->left % (4 * OMNI_MAX_WHEELS); /* a quarter of the ticks: the time is scarce */
        if (wheel < OMNI_MAX_WHEELS) {
            const omni_real_t reference = omni_absf(actuation->wheel_reference[wheel]);
            const omni_real_t peak = speeds->reference[wheel];
            speeds->reference[wheel] = omni_select(reference > peak, reference, peak);
        }
        speeds->left -= estimate->steps;
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
    omni_robot_reference(&robot->guide, config, inputs, estimate, kind, &target);
    target.exciter = robot->exciter.left == 0 ? NULL : omni_robot_excite(&robot->exciter, config, inputs, &target);
    OMNI_INVARIANT(target.armed || (!target.position_loop && target.kind == OMNI_SETPOINT_NONE));
    omni_robot_control(&robot->control, config, inputs, estimate, &target, &robot->applied, &actuation);
    if (config->current.watched) {
        robot->applied.current_cut = 0.0f;
        if (config->current.limited && target.armed) {
            omni_robot_limit_currents(&robot->control, config, &robot->supervisor.current, estimate->supply_V,
                                      &robot->applied, &actuation);
        }
    }
    watch_speeds_when_due(robot, estimate, &target, &actuation);
    faults |= omni_robot_gain_margin(&robot->margin, config, &robot->estimator.pose_ekf, estimate, &target);
    faults |= seal_actuation(&robot->supervisor, estimate->supply_V, &robot->applied, &actuation);
    robot->supervisor.faults = faults;
    report_estimate(&robot->estimator, config, estimate, outputs);
    report_control(robot, &target, &actuation, outputs);
    memcpy(outputs->ismc_margin, robot->margin.margin, sizeof outputs->ismc_margin);
    memset(outputs->motor_heat, 0, sizeof outputs->motor_heat);
    outputs->current_cut = 0.0f;
    if (config->current.watched) {
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
    faults |= omni_robot_supervise(&robot->supervisor, robot->config, inputs, &estimate, &robot->applied, &kind);
    apply_events(robot, inputs, faults, &estimate);
    drive_and_report(robot, inputs, &estimate, kind, faults, outputs);
    omni_robot_restart_filters(&robot->estimator, robot->config, &estimate);
}

uint32_t omni_robot_arming_faults(const omni_robot_t *robot) {
    const omni_uint_t now = robot->supervisor.faults | robot->supervisor.speeds.fault;
    const uint32_t faults = (uint32_t)(now & (uint32_t)OMNI_FAULT_STOP_MASK);
    return robot->supervisor.state == OMNI_STATE_DISARMED ? faults : faults | (uint32_t)OMNI_FAULT_CONFIG;
}
