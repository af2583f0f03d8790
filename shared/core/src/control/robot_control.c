/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "../math/invariant.h"
#include "../model/kinematics_inline.h"
#include "controllers.h"
#include "omni/saturation.h"

/* Step the controller every CTL_PERIOD ticks; its output is held in between. Voltage controllers are stepped always. */
static void step_controller(omni_control_state_t *control, const omni_robot_config_t *c,
                            const omni_estimate_t *estimate, const omni_target_t *target, omni_flag_t saturated) {
    const omni_controller_t *controller = omni_controllers[c->controller];
    if (control->ticks == 0) {
        controller->step(control, c, estimate, &target->reference, saturated);
    }
    ++control->ticks;
    if (control->ticks >= c->control_period || controller->demand == OMNI_DEMAND_VOLTAGE) {
        control->ticks = 0;
    }
}

/* Add the torque for the body's inertia, from R xi''. The derivative of the body rate is R xi'' + R' xi', so the term
 * of the rotation is subtracted. Only a path without a controller already gives R xi''. */
static void add_body_inertia_feedforward(const omni_robot_config_t *c, const omni_target_t *target,
                                         omni_twist_t inertial, const omni_twist_t *rate, omni_real_t *acceleration) {
    const bool velocity = target->kind == OMNI_SETPOINT_VELOCITY_BODY || target->kind == OMNI_SETPOINT_VELOCITY_WORLD;
    if (target->position_loop || velocity) {
        inertial.vx -= rate->wz * rate->vy;
        inertial.vy += rate->wz * rate->vx;
    }
    omni_kinematics_add_body_inertia(&c->kinematics, &c->body_load, &inertial, acceleration);
}

/* Wheel acceleration of the reference, from its exact second derivative: phi'' = B (R xi'' + R' xi') / r. */
static void compute_wheel_acceleration(const omni_robot_config_t *c, const omni_target_t *target,
                                       omni_real_t *acceleration) {
    const omni_reference_t *reference = &target->reference;
    const omni_rotation_t heading = omni_rotation(reference->pose.theta);
    const omni_twist_t rate = omni_rotate_to_body(&reference->rate, &heading);
    omni_twist_t body = omni_rotate_to_body(&reference->acceleration, &heading);
    if (target->position_loop) { /* a body-frame velocity has no term of the rotation */
        body.vx += rate.wz * rate.vy;
        body.vy -= rate.wz * rate.vx;
    }
    omni_kinematics_inverse(&c->kinematics, &body, NULL, acceleration);
    if (c->body_load.used) {
        add_body_inertia_feedforward(c, target, body, &rate, acceleration);
    }
}

/* Slip ratio s: the contact moves r phi' (1 - s), so phi' = v / (r (1 - s)); eq. 20 and 41 with v_s = s r phi'. Only
 * while fixes correct the estimate: without them a wrong ratio would cause the slip that seems to confirm it. */
static void compensate_slip(const omni_robot_config_t *c, const omni_estimate_t *estimate, omni_real_t *wheel_rad_s) {
    if (c->pose_ekf.mode != OMNI_EKF_MODE_SLIP || !estimate->fix_is_fresh) {
        return;
    }
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        const omni_real_t ratio = omni_clampf(c->slip_feedforward * estimate->slip_ratio[i], -0.5f, 0.5f);
        wheel_rad_s[i] /= 1.0f - ratio;
    }
}

/* Body twist to wheel speeds, wheel speeds to duties. */
static void actuate_twist(omni_control_state_t *control, const omni_robot_config_t *c, const omni_estimate_t *estimate,
                          const omni_target_t *target, omni_actuation_t *actuation) {
    const omni_twist_t *body = target->position_loop ? &control->demand.twist : &target->body_rate;
    omni_real_t acceleration[OMNI_MAX_WHEELS];
    omni_real_t voltage_V[OMNI_MAX_WHEELS];
    omni_kinematics_inverse(&c->kinematics, body, NULL, actuation->wheel_reference);
    compensate_slip(c, estimate, actuation->wheel_reference);
    const bool single_wheel = target->excitation != NULL && target->excitation->plan.place == OMNI_EXCITATION_WHEEL;
    if (single_wheel) {
        omni_add_wheel_excitation(target->excitation, c->kinematics.wheels, 1.0f, c->limits.wheel_rad_s,
                                  actuation->wheel_reference);
    }
    compute_wheel_acceleration(c, target, acceleration);
    actuation->wheel_scale =
        omni_saturate_direction(actuation->wheel_reference, c->kinematics.wheels, c->limits.wheel_rad_s);
    actuation->duty_scale =
        omni_wheel_speed_step(&control->wheel_speed, &c->wheel_speed, actuation->wheel_reference, acceleration,
                              estimate->wheel_rad_s, estimate->supply_V, actuation->duty, voltage_V);
    if (c->kinematics.has_null && !single_wheel) { /* the references are consistent with a rigid body */
        omni_wheel_speed_balance(&control->wheel_speed, &c->wheel_speed);
    }
}

/* Wheel voltages to duties. */
static void actuate_voltages(const omni_robot_config_t *c, const omni_demand_t *demand, omni_real_t supply_V,
                             omni_actuation_t *actuation) {
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        actuation->wheel_reference[i] = demand->wheel_rad_s[i];
        actuation->duty[i] = demand->voltage_V[i] / supply_V;
    }
    actuation->duty_scale = omni_saturate_direction(actuation->duty, c->kinematics.wheels, c->wheel_speed.duty_limit);
}

/* Torques to duties at the wheels' speed. If the supply is not sufficient the torques are reduced by one factor for all
 * wheels (eq. 30); the compensation of back-EMF and friction is kept. @return the factor. */
static omni_real_t torques_to_duties(const omni_robot_config_t *c, const omni_real_t *torque_N_m,
                                     const omni_estimate_t *estimate, omni_real_t *duty) {
    const omni_real_t per_V = 1.0f / estimate->supply_V;
    const omni_real_t limit = c->wheel_speed.duty_limit;
    omni_real_t push[OMNI_MAX_WHEELS] = {0};
    omni_real_t keep[OMNI_MAX_WHEELS] = {0};
    omni_real_t factor = 1.0f;
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        push[i] = omni_torque_curve_duty(&c->torque_curve, torque_N_m[i]) * c->limits.supply_nominal_V * per_V;
        keep[i] =
            omni_clampf(c->emf_compensation * c->speed_gain_V_s * estimate->wheel_rad_s[i] * per_V, -limit, limit);
        const omni_real_t room = limit - omni_signf(push[i]) * keep[i];
        const omni_real_t wanted = omni_absf(push[i]);
        factor = omni_select(wanted * factor > room, room / wanted, factor);
    }
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        duty[i] = omni_clampf(keep[i] + factor * push[i], -limit, limit);
    }
    return factor;
}

/* Wheel torques to duties. The floor speed is not measured; the runaway protection uses the reference's speed. */
static void actuate_torques(const omni_robot_config_t *c, const omni_demand_t *demand, const omni_estimate_t *estimate,
                            const omni_reference_t *reference, omni_actuation_t *actuation) {
    omni_real_t torque_N_m[OMNI_MAX_WHEELS];
    memcpy(torque_N_m, demand->torque_N_m, sizeof torque_N_m);
    const omni_twist_t floor = omni_rotate_to_body(&reference->rate, &estimate->heading);
    omni_kinematics_inverse(&c->kinematics, &floor, NULL, actuation->wheel_reference);
    actuation->wheel_scale =
        omni_direct_torque_protect(&c->direct_torque, &c->kinematics, &floor, estimate->wheel_rad_s, torque_N_m);
    actuation->duty_scale = demand->torque_scale * torques_to_duties(c, torque_N_m, estimate, actuation->duty);
}

static void actuate_duties(const omni_robot_config_t *c, const omni_real_t *duty, omni_actuation_t *actuation) {
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        actuation->duty[i] = duty[i];
    }
    actuation->duty_scale = omni_saturate_direction(actuation->duty, c->kinematics.wheels, c->wheel_speed.duty_limit);
}

static bool exceeds_tracking_limit(const omni_robot_config_t *c, const omni_control_terms_t *terms) {
    const omni_real_t distance2 = terms->error[0] * terms->error[0] + terms->error[1] * terms->error[1];
    return distance2 > c->limits.error_m * c->limits.error_m || omni_absf(terms->error[2]) > c->limits.error_rad;
}

/* omni_demand_kind_t of this tick. Velocity setpoints are twists. */
static uint8_t select_actuation_mode(const omni_robot_config_t *c, const omni_target_t *target) {
    if (target->kind == OMNI_SETPOINT_DUTY) {
        return OMNI_DEMAND_DUTY;
    }
    return target->position_loop ? omni_controllers[c->controller]->demand : (uint8_t)OMNI_DEMAND_TWIST;
}

/* Reset loops that were not active in the last tick: their old integrals would cause a jump. All controllers are reset,
 * not only the new one, so that the state does not depend on earlier modes. */
static void reset_on_takeover(omni_control_state_t *control, const omni_robot_config_t *c, const omni_target_t *target,
                              uint8_t mode, omni_applied_t *applied) {
    if (target->position_loop != control->tracking || c->controller != control->last_controller) {
        omni_controllers_reset(control);
    }
    if (mode != control->last_actuation_mode) {
        omni_wheel_speed_reset(&control->wheel_speed);
        applied->saturated = false;
    }
    control->last_actuation_mode = mode;
}

void omni_robot_control_reset(omni_control_state_t *control) {
    omni_controllers_reset(control);
    omni_wheel_speed_reset(&control->wheel_speed);
    control->tracking = false;
}

static void actuate_demand(omni_control_state_t *control, const omni_robot_config_t *c, const omni_inputs_t *inputs,
                           const omni_estimate_t *estimate, const omni_target_t *target, omni_actuation_t *actuation) {
    switch (control->last_actuation_mode) {
    case OMNI_DEMAND_DUTY:
        actuate_duties(c, inputs->setpoint.duty, actuation);
        break;
    case OMNI_DEMAND_VOLTAGE:
        actuate_voltages(c, &control->demand, estimate->supply_V, actuation);
        break;
    case OMNI_DEMAND_TORQUE:
        actuate_torques(c, &control->demand, estimate, &target->reference, actuation);
        break;
    default:
        actuate_twist(control, c, estimate, target, actuation);
        break;
    }
}

void omni_robot_control(omni_control_state_t *control, const omni_robot_config_t *config, const omni_inputs_t *inputs,
                        const omni_estimate_t *estimate, const omni_target_t *target, omni_applied_t *applied,
                        omni_actuation_t *actuation) {
    memset(actuation->duty, 0, sizeof actuation->duty);
    memset(actuation->wheel_reference, 0, sizeof actuation->wheel_reference);
    actuation->wheel_scale = 1.0f;
    actuation->duty_scale = 1.0f;
    OMNI_INVARIANT(config->controller < OMNI_CTL_MODE_COUNT && config->control_period > 0);
    if (target->armed) {
        reset_on_takeover(control, config, target, select_actuation_mode(config, target), applied);
        if (target->position_loop) {
            step_controller(control, config, estimate, target, applied->saturated);
        }
        actuate_demand(control, config, inputs, estimate, target, actuation);
        if (target->excitation != NULL && target->excitation->plan.place == OMNI_EXCITATION_VOLTAGE) {
            omni_add_wheel_excitation(target->excitation, config->kinematics.wheels, 1.0f / estimate->supply_V,
                                      config->wheel_speed.duty_limit, actuation->duty);
        }
    }
    control->tracking = target->position_loop;
    control->last_controller = config->controller;
    applied->saturated = actuation->wheel_scale < 1.0f || actuation->duty_scale < 1.0f;
    applied->tracking_error_exceeded = target->position_loop && exceeds_tracking_limit(config, &control->demand.terms);
}
