/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "../math/invariant.h"
#include "../model/kinematics_inline.h"
#include "controllers.h"
#include "omni/saturation.h"

/* A step every CTL_PERIOD ticks; what is asked for is held in between. Voltages have a period of their own. */
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

/* What the body asks of the wheels on top: R xi''. The change of the body's rate is R xi'' + R' xi', so the turning is
 * taken out of it. Only a path without a controller gives R xi'' as it is. */
static void feed_body(const omni_robot_config_t *c, const omni_target_t *target, omni_twist_t felt,
                      const omni_twist_t *rate, omni_real_t *acceleration) {
    const bool velocity = target->kind == OMNI_SETPOINT_VELOCITY_BODY || target->kind == OMNI_SETPOINT_VELOCITY_WORLD;
    if (target->position_loop || velocity) {
        felt.vx -= rate->wz * rate->vy;
        felt.vy += rate->wz * rate->vx;
    }
    omni_kinematics_add_body(&c->kinematics, &c->body_load, &felt, acceleration);
}

/* Wheel acceleration of the reference, from its exact second derivative: phi'' = B (R xi'' + R' xi') / r. */
static void feed_acceleration(const omni_robot_config_t *c, const omni_target_t *target, omni_real_t *acceleration) {
    const omni_reference_t *reference = &target->reference;
    const omni_rotation_t heading = omni_rotation(reference->pose.theta);
    const omni_twist_t rate = omni_rotate_to_body(&reference->rate, &heading);
    omni_twist_t body = omni_rotate_to_body(&reference->acceleration, &heading);
    if (target->position_loop) { /* a body-frame velocity demand does not turn with the world */
        body.vx += rate.wz * rate.vy;
        body.vy -= rate.wz * rate.vx;
    }
    omni_kinematics_inverse(&c->kinematics, &body, NULL, acceleration);
    if (c->body_load.used) {
        feed_body(c, target, body, &rate, acceleration);
    }
}

/* Slip ratio s: the contact moves r phi' (1 - s), so phi' = v / (r (1 - s)); eq. 20 and 41 with v_s = s r phi'. Only
 * while fixes keep the estimate honest: without them a wrong ratio would make the very slip that seems to confirm it.
 */
static void compensate_slip(const omni_robot_config_t *c, const omni_estimate_t *estimate, omni_real_t *wheel_rad_s) {
    if (c->pose_ekf.mode != OMNI_EKF_MODE_SLIP || !estimate->fix_is_fresh) {
        return;
    }
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        const omni_real_t ratio = omni_clampf(c->slip_feed * estimate->slip_ratio[i], -0.5f, 0.5f);
        wheel_rad_s[i] /= 1.0f - ratio;
    }
}

/* A twist: to speeds of the wheels, and these to voltages. */
static void wheel_loops(omni_control_state_t *control, const omni_robot_config_t *c, const omni_estimate_t *estimate,
                        const omni_target_t *target, omni_actuation_t *actuation) {
    const omni_twist_t *body = target->position_loop ? &control->demand.twist : &target->body_rate;
    omni_real_t acceleration[OMNI_MAX_WHEELS];
    omni_real_t voltage_V[OMNI_MAX_WHEELS];
    omni_kinematics_inverse(&c->kinematics, body, NULL, actuation->wheel_reference);
    compensate_slip(c, estimate, actuation->wheel_reference);
    const bool one_by_one = target->exciter != NULL && target->exciter->plan.place == OMNI_EXCITATION_WHEEL;
    if (one_by_one) {
        omni_robot_excite_wheels(target->exciter, c->kinematics.wheels, 1.0f, c->limits.wheel_rad_s,
                                 actuation->wheel_reference);
    }
    feed_acceleration(c, target, acceleration);
    actuation->wheel_scale =
        omni_saturate_direction(actuation->wheel_reference, c->kinematics.wheels, c->limits.wheel_rad_s);
    actuation->duty_scale =
        omni_wheel_speed_step(&control->wheel_speed, &c->wheel_speed, actuation->wheel_reference, acceleration,
                              estimate->wheel_rad_s, estimate->supply_V, actuation->duty, voltage_V);
    if (c->kinematics.has_null && !one_by_one) { /* the references are those of one body */
        omni_wheel_speed_balance(&control->wheel_speed, &c->wheel_speed);
    }
}

/* Voltages as they are. */
static void voltage_duties(const omni_robot_config_t *c, const omni_demand_t *demand, omni_real_t supply_V,
                           omni_actuation_t *actuation) {
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        actuation->wheel_reference[i] = demand->wheel_rad_s[i];
        actuation->duty[i] = demand->voltage_V[i] / supply_V;
    }
    actuation->duty_scale = omni_saturate_direction(actuation->duty, c->kinematics.wheels, c->wheel_speed.duty_limit);
}

/* Duties that give the torques at the wheels' speed. Where the supply does not suffice only the torques shrink, by one
 * factor for all wheels (eq. 30); the share that makes up for the motors' own back-EMF and friction stays. @return that
 * factor. */
static omni_real_t torque_duties(const omni_robot_config_t *c, const omni_real_t *torque_N_m,
                                 const omni_estimate_t *estimate, omni_real_t *duty) {
    const omni_real_t per_V = 1.0f / estimate->supply_V;
    const omni_real_t limit = c->wheel_speed.duty_limit;
    omni_real_t push[OMNI_MAX_WHEELS] = {0};
    omni_real_t keep[OMNI_MAX_WHEELS] = {0};
    omni_real_t factor = 1.0f;
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        push[i] = omni_torque_curve_duty(&c->torque_curve, torque_N_m[i]) * c->limits.supply_nominal_V * per_V;
        keep[i] = omni_clampf(c->torque_emf * c->speed_gain_V_s * estimate->wheel_rad_s[i] * per_V, -limit, limit);
        const omni_real_t room = limit - omni_signf(push[i]) * keep[i];
        const omni_real_t wanted = omni_absf(push[i]);
        factor = omni_select(wanted * factor > room, room / wanted, factor);
    }
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        duty[i] = omni_clampf(keep[i] + factor * push[i], -limit, limit);
    }
    return factor;
}

/* Torques. What the floor does below the wheels the robot cannot see; the reference's speed stands for it in the
 * runaway protection. */
static void protect_torques(const omni_robot_config_t *c, const omni_demand_t *demand, const omni_estimate_t *estimate,
                            const omni_reference_t *reference, omni_actuation_t *actuation) {
    omni_real_t torque_N_m[OMNI_MAX_WHEELS];
    memcpy(torque_N_m, demand->torque_N_m, sizeof torque_N_m);
    const omni_twist_t floor = omni_rotate_to_body(&reference->rate, &estimate->heading);
    omni_kinematics_inverse(&c->kinematics, &floor, NULL, actuation->wheel_reference);
    actuation->wheel_scale =
        omni_direct_torque_protect(&c->direct_torque, &c->kinematics, &floor, estimate->wheel_rad_s, torque_N_m);
    actuation->duty_scale = demand->torque_scale * torque_duties(c, torque_N_m, estimate, actuation->duty);
}

static void open_loop(const omni_robot_config_t *c, const omni_real_t *duty, omni_actuation_t *actuation) {
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        actuation->duty[i] = duty[i];
    }
    actuation->duty_scale = omni_saturate_direction(actuation->duty, c->kinematics.wheels, c->wheel_speed.duty_limit);
}

static bool is_off_track(const omni_robot_config_t *c, const omni_control_terms_t *terms) {
    const omni_real_t distance2 = terms->error[0] * terms->error[0] + terms->error[1] * terms->error[1];
    return distance2 > c->limits.error_m * c->limits.error_m || omni_absf(terms->error[2]) > c->limits.error_rad;
}

/* omni_demand_kind_t: which way the wheels are driven. Velocities go the way of twists. */
static uint8_t way_of(const omni_robot_config_t *c, const omni_target_t *target) {
    if (target->kind == OMNI_SETPOINT_DUTY) {
        return OMNI_DEMAND_DUTY;
    }
    return target->position_loop ? omni_controllers[c->controller]->demand : (uint8_t)OMNI_DEMAND_TWIST;
}

/* Integrals of loops that did not drive the robot in the last tick are of another time: with them the wheels would
 * jerk. All controllers forget, not only the one that takes over: a robot's state then says nothing of what it did
 * before. */
static void hand_over(omni_control_state_t *control, const omni_robot_config_t *c, const omni_target_t *target,
                      uint8_t way, omni_applied_t *applied) {
    if (target->position_loop != control->tracking || c->controller != control->last_controller) {
        omni_controllers_reset(control);
    }
    if (way != control->last_way) {
        omni_wheel_speed_reset(&control->wheel_speed);
        applied->saturated = false;
    }
    control->last_way = way;
}

void omni_robot_control_reset(omni_control_state_t *control) {
    omni_controllers_reset(control);
    omni_wheel_speed_reset(&control->wheel_speed);
    control->tracking = false;
}

static void drive_wheels(omni_control_state_t *control, const omni_robot_config_t *c, const omni_inputs_t *inputs,
                         const omni_estimate_t *estimate, const omni_target_t *target, omni_actuation_t *actuation) {
    switch (control->last_way) {
    case OMNI_DEMAND_DUTY:
        open_loop(c, inputs->setpoint.duty, actuation);
        break;
    case OMNI_DEMAND_VOLTAGE:
        voltage_duties(c, &control->demand, estimate->supply_V, actuation);
        break;
    case OMNI_DEMAND_TORQUE:
        protect_torques(c, &control->demand, estimate, &target->reference, actuation);
        break;
    default:
        wheel_loops(control, c, estimate, target, actuation);
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
        hand_over(control, config, target, way_of(config, target), applied);
        if (target->position_loop) {
            step_controller(control, config, estimate, target, applied->saturated);
        }
        drive_wheels(control, config, inputs, estimate, target, actuation);
        if (target->exciter != NULL && target->exciter->plan.place == OMNI_EXCITATION_VOLTAGE) {
            omni_robot_excite_wheels(target->exciter, config->kinematics.wheels, 1.0f / estimate->supply_V,
                                     config->wheel_speed.duty_limit, actuation->duty);
        }
    }
    control->tracking = target->position_loop;
    control->last_controller = config->controller;
    applied->saturated = actuation->wheel_scale < 1.0f || actuation->duty_scale < 1.0f;
    applied->off_track = target->position_loop && is_off_track(config, &control->demand.terms);
}
