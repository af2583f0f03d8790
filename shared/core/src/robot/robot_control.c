/* SPDX-License-Identifier: MIT */
#include "robot_internal.h"

#include <string.h>

#include "../control/pose_control.h"
#include "../kinematics/kinematics_inline.h"
#include "../math/invariant.h"
#include "omni/saturation.h"

/* Pose error to wanted body twist or, in direct torque control, to torques, by the controller in use. */
static void step_position_controller(omni_control_state_t *control, const omni_robot_config_t *c,
                                     const omni_estimate_t *estimate, const omni_reference_t *reference,
                                     omni_flag_t saturated) {
    const omni_pose_t *pose = &estimate->pose;
    omni_control_terms_t *terms = &control->terms;
    omni_twist_t world;
    if (c->controller == OMNI_CTL_MODE_TORQUE) {
        control->held_scale = omni_direct_torque_step(&c->torque, &c->kinematics, pose, &estimate->rate, reference,
                                                      control->held_torque_N_m, terms);
        return;
    }
    if (c->controller == OMNI_CTL_MODE_ISMC) {
        world = omni_ismc_step(&control->ismc, &c->ismc, pose, &reference->pose, &reference->rate, saturated, terms);
    } else {
        world = omni_fl_step(&control->fl, &c->fl, pose, &estimate->rate, &reference->pose, &reference->rate, saturated, terms);
    }
    control->held_twist = omni_rotate_to_body(&world, &estimate->heading);
}

/* The position controller steps every CTL_PERIOD ticks; what it wants of the wheels is held in between. */
static void position_controller(omni_control_state_t *control, const omni_robot_config_t *c, const omni_estimate_t *estimate,
                                const omni_reference_t *reference, omni_flag_t saturated) {
    if (control->ticks == 0) {
        step_position_controller(control, c, estimate, reference, saturated);
    }
    ++control->ticks;
    if (control->ticks >= c->control_period) {
        control->ticks = 0;
    }
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
}

/* Slip ratio s: the contact moves r phi' (1 - s), so phi' = v / (r (1 - s)); eq. 20 and 41 with v_s = s r phi'. Only while
 * fixes keep the estimate honest: without them a wrong ratio would make the very slip that seems to confirm it. */
static void compensate_slip(const omni_robot_config_t *c, const omni_estimate_t *estimate, omni_real_t *wheel_rad_s) {
    if (c->pose_ekf.mode != OMNI_EKF_MODE_SLIP || !estimate->fix_is_fresh) {
        return;
    }
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        const omni_real_t ratio = omni_clampf(c->slip_feed * estimate->slip_ratio[i], -0.5f, 0.5f);
        wheel_rad_s[i] /= 1.0f - ratio;
    }
}

static void wheel_loops(omni_control_state_t *control, const omni_robot_config_t *c, const omni_estimate_t *estimate,
                        const omni_target_t *target, omni_flag_t saturated, omni_actuation_t *actuation) {
    const omni_twist_t *body = &target->body_rate;
    omni_real_t acceleration[OMNI_MAX_WHEELS];
    omni_real_t voltage_V[OMNI_MAX_WHEELS];
    if (target->position_loop) {
        position_controller(control, c, estimate, &target->reference, saturated);
        body = &control->held_twist;
    }
    omni_kinematics_inverse(&c->kinematics, body, NULL, actuation->wheel_reference);
    compensate_slip(c, estimate, actuation->wheel_reference);
    feed_acceleration(c, target, acceleration);
    actuation->wheel_scale = omni_saturate_direction(actuation->wheel_reference, c->kinematics.wheels, c->limits.wheel_rad_s);
    actuation->duty_scale =
        omni_wheel_speed_step(&control->wheel_speed, &c->wheel_speed, actuation->wheel_reference, acceleration,
                              estimate->wheel_rad_s, estimate->supply_V, actuation->duty, voltage_V);
}

/* The original law commands voltages itself. */
static void original_law(omni_control_state_t *control, const omni_robot_config_t *c, const omni_estimate_t *estimate,
                         const omni_reference_t *reference, omni_actuation_t *actuation) {
    omni_original_state_t *original = &control->original;
    omni_original_step(original, &c->original, &c->kinematics, estimate->delta_counts, &estimate->pose, &reference->pose,
                       &reference->rate, estimate->supply_V);
    omni_pose_error(&estimate->pose, &reference->pose, control->terms.error);
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        actuation->wheel_reference[i] = original->wheel_reference[i];
        actuation->duty[i] = original->voltage_V[i] / estimate->supply_V;
    }
    actuation->duty_scale = omni_saturate_direction(actuation->duty, c->kinematics.wheels, c->wheel_speed.duty_limit);
}

/* Duties that give the torques at the wheels' speed. Where the supply does not suffice only the torques shrink, by one factor for
 * all wheels (eq. 30); the share that makes up for the motors' own back-EMF and friction stays. @return that factor. */
static omni_real_t torque_duties(const omni_robot_config_t *c, const omni_real_t *torque_N_m, const omni_estimate_t *estimate,
                                 omni_real_t *duty) {
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

/* Direct torque control commands voltages itself. What the floor does below the wheels the robot cannot see; the reference's speed
 * stands for it in the runaway protection. */
static void torque_control(omni_control_state_t *control, const omni_robot_config_t *c, const omni_estimate_t *estimate,
                           const omni_reference_t *reference, omni_flag_t saturated, omni_actuation_t *actuation) {
    omni_real_t torque_N_m[OMNI_MAX_WHEELS];
    position_controller(control, c, estimate, reference, saturated);
    memcpy(torque_N_m, control->held_torque_N_m, sizeof torque_N_m);
    const omni_twist_t floor = omni_rotate_to_body(&reference->rate, &estimate->heading);
    omni_kinematics_inverse(&c->kinematics, &floor, NULL, actuation->wheel_reference);
    actuation->wheel_scale = omni_direct_torque_protect(&c->torque, &c->kinematics, &floor, estimate->wheel_rad_s, torque_N_m);
    actuation->duty_scale = control->held_scale * torque_duties(c, torque_N_m, estimate, actuation->duty);
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

static uint8_t driver_of(const omni_robot_config_t *c, const omni_target_t *target) {
    if (target->kind == OMNI_SETPOINT_DUTY) {
        return OMNI_DRIVER_DUTY;
    }
    if (target->position_loop && c->controller == OMNI_CTL_MODE_ORIGINAL) {
        return OMNI_DRIVER_ORIGINAL;
    }
    return target->position_loop && c->controller == OMNI_CTL_MODE_TORQUE ? OMNI_DRIVER_TORQUE : OMNI_DRIVER_LOOPS;
}

/* Integrals of loops that did not drive the robot in the last tick are of another time: with them the wheels would jerk. */
static void hand_over(omni_control_state_t *control, const omni_robot_config_t *c, const omni_target_t *target, uint8_t driver,
                      omni_applied_t *applied) {
    if (c->controller != control->last_controller || !target->position_loop) {
        omni_ismc_reset(&control->ismc);
        omni_fl_reset(&control->fl);
        control->ticks = 0;
    }
    if (driver != control->last_driver) {
        omni_original_reset(&control->original);
        omni_wheel_speed_reset(&control->wheel_speed);
        memset(&control->terms, 0, sizeof control->terms);
        applied->saturated = false;
    }
    control->last_driver = driver;
}

void omni_robot_control_reset(omni_control_state_t *control) {
    omni_ismc_reset(&control->ismc);
    omni_fl_reset(&control->fl);
    omni_original_reset(&control->original);
    omni_wheel_speed_reset(&control->wheel_speed);
    control->ticks = 0;
}

static void drive(omni_control_state_t *control, const omni_robot_config_t *c, const omni_inputs_t *inputs,
                  const omni_estimate_t *estimate, const omni_target_t *target, omni_flag_t saturated,
                  omni_actuation_t *actuation) {
    switch (control->last_driver) {
    case OMNI_DRIVER_DUTY:
        open_loop(c, inputs->setpoint.duty, actuation);
        break;
    case OMNI_DRIVER_ORIGINAL:
        original_law(control, c, estimate, &target->reference, actuation);
        break;
    case OMNI_DRIVER_TORQUE:
        torque_control(control, c, estimate, &target->reference, saturated, actuation);
        break;
    default:
        wheel_loops(control, c, estimate, target, saturated, actuation);
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
        hand_over(control, config, target, driver_of(config, target), applied);
        drive(control, config, inputs, estimate, target, applied->saturated, actuation);
    }
    control->last_controller = config->controller;
    applied->saturated = actuation->wheel_scale < 1.0f || actuation->duty_scale < 1.0f;
    applied->off_track = target->position_loop && is_off_track(config, &control->terms);
}
