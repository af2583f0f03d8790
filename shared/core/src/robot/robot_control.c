/* SPDX-License-Identifier: MIT */
#include "robot_internal.h"

#include <string.h>

#include "../kinematics/kinematics_inline.h"
#include "omni/saturation.h"

/* Pose error to wanted body twist or, in direct torque control, to torques, by the controller in use. */
static void step_position_controller(omni_robot_t *robot, const omni_tick_t *tick) {
    const omni_robot_config_t *c = robot->config;
    const omni_outputs_t *out = tick->out;
    const omni_reference_t *reference = &out->reference;
    omni_control_terms_t *terms = &robot->held_terms;
    omni_twist_t world;
    if (c->controller == OMNI_CTL_MODE_TORQUE) {
        robot->held_scale = omni_direct_torque_step(&c->torque, &c->kinematics, &out->pose, &out->rate, reference,
                                                    robot->held_torque_N_m, terms);
        return;
    }
    if (c->controller == OMNI_CTL_MODE_ISMC) {
        world = omni_ismc_step(&robot->ismc, &c->ismc, &out->pose, &reference->pose, &reference->rate, robot->saturated, terms);
    } else {
        world = omni_fl_step(&robot->fl, &c->fl, &out->pose, &out->rate, &reference->pose, &reference->rate, robot->saturated,
                             terms);
    }
    robot->held_twist = omni_rotate_to_body(&world, &tick->heading);
}

/* The position controller steps every CTL_PERIOD ticks; what it wants of the wheels is held in between. */
static void position_controller(omni_robot_t *robot, omni_tick_t *tick) {
    if (robot->control_ticks == 0) {
        step_position_controller(robot, tick);
    }
    ++robot->control_ticks;
    if (robot->control_ticks >= robot->config->control_period) {
        robot->control_ticks = 0;
    }
    tick->out->terms = robot->held_terms;
}

/* Wheel acceleration of the reference, from its exact second derivative: phi'' = B (R xi'' + R' xi') / r. */
static void feed_acceleration(const omni_robot_config_t *c, omni_tick_t *tick) {
    const omni_reference_t *reference = &tick->out->reference;
    const omni_rotation_t heading = omni_rotation(reference->pose.theta);
    const omni_twist_t rate = omni_rotate_to_body(&reference->rate, &heading);
    omni_twist_t body = omni_rotate_to_body(&reference->acceleration, &heading);
    if (tick->position_loop) { /* a body-frame velocity demand does not turn with the world */
        body.vx += rate.wz * rate.vy;
        body.vy -= rate.wz * rate.vx;
    }
    omni_kinematics_inverse(&c->kinematics, &body, NULL, tick->acceleration);
}

/* Slip ratio s: the contact moves r phi' (1 - s), so phi' = v / (r (1 - s)); eq. 20 and 41 with v_s = s r phi'. Only while
 * fixes keep the estimate honest: without them a wrong ratio would make the very slip that seems to confirm it. */
static void compensate_slip(const omni_robot_t *robot, omni_tick_t *tick) {
    const omni_robot_config_t *c = robot->config;
    if (c->pose_ekf.mode != OMNI_EKF_MODE_SLIP || !tick->fix_is_fresh) {
        return;
    }
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        const omni_real_t ratio = omni_clampf(c->slip_feed * robot->pose_ekf.slip[i], -0.5f, 0.5f);
        tick->body_wheel[i] /= 1.0f - ratio;
    }
}

static void wheel_references(omni_robot_t *robot, omni_tick_t *tick) {
    const omni_robot_config_t *c = robot->config;
    omni_outputs_t *out = tick->out;
    omni_twist_t body = tick->body_rate;
    if (tick->position_loop) {
        position_controller(robot, tick);
        body = robot->held_twist;
    }
    omni_kinematics_inverse(&c->kinematics, &body, NULL, tick->body_wheel);
    compensate_slip(robot, tick);
    feed_acceleration(c, tick);
    out->wheel_scale = omni_saturate_direction(tick->body_wheel, c->kinematics.wheels, c->limits.wheel_rad_s);
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        out->wheel_reference[i] = tick->body_wheel[i];
    }
    out->duty_scale = omni_wheel_speed_step(&robot->wheel_speed, &c->wheel_speed, tick->body_wheel, tick->acceleration,
                                            out->wheel_rad_s, out->supply_V, out->duty, out->voltage_V);
}

/* The original law commands voltages itself. */
static void original_law(omni_robot_t *robot, omni_tick_t *tick) {
    const omni_robot_config_t *c = robot->config;
    omni_outputs_t *out = tick->out;
    omni_original_step(&robot->original, &c->original, &c->kinematics, tick->delta_counts, &out->pose, &out->reference.pose,
                       &out->reference.rate, out->supply_V);
    out->terms.error[0] = out->pose.x - out->reference.pose.x;
    out->terms.error[1] = out->pose.y - out->reference.pose.y;
    out->terms.error[2] = omni_wrap_pi(out->pose.theta - out->reference.pose.theta);
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        out->wheel_reference[i] = robot->original.wheel_reference[i];
        out->duty[i] = robot->original.voltage_V[i] / out->supply_V;
    }
    out->duty_scale = omni_saturate_direction(out->duty, c->kinematics.wheels, c->wheel_speed.duty_limit);
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        out->voltage_V[i] = out->duty[i] * out->supply_V;
    }
}

/* Duties that give the torques at the wheels' speed. Where the supply does not suffice only the torques shrink, by one factor for
 * all wheels (eq. 30); the share that makes up for the motors' own back-EMF and friction stays. @return that factor. */
static omni_real_t torque_duties(const omni_robot_config_t *c, const omni_real_t *torque_N_m, omni_outputs_t *out) {
    const omni_real_t per_V = 1.0f / out->supply_V;
    const omni_real_t limit = c->wheel_speed.duty_limit;
    omni_real_t push[OMNI_MAX_WHEELS] = {0};
    omni_real_t keep[OMNI_MAX_WHEELS] = {0};
    omni_real_t factor = 1.0f;
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        push[i] = omni_torque_curve_duty(&c->torque_curve, torque_N_m[i]) * c->limits.supply_nominal_V * per_V;
        keep[i] = omni_clampf(c->torque_emf * c->speed_gain_V_s * out->wheel_rad_s[i] * per_V, -limit, limit);
        const omni_real_t room = limit - omni_signf(push[i]) * keep[i];
        const omni_real_t wanted = omni_absf(push[i]);
        factor = omni_select(wanted * factor > room, room / wanted, factor);
    }
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        out->duty[i] = omni_clampf(keep[i] + factor * push[i], -limit, limit);
        out->voltage_V[i] = out->duty[i] * out->supply_V;
    }
    return factor;
}

/* Direct torque control commands voltages itself. What the floor does below the wheels the robot cannot see; the reference's speed
 * stands for it in the runaway protection. */
static void torque_control(omni_robot_t *robot, omni_tick_t *tick) {
    const omni_robot_config_t *c = robot->config;
    omni_outputs_t *out = tick->out;
    omni_real_t torque_N_m[OMNI_MAX_WHEELS];
    position_controller(robot, tick);
    memcpy(torque_N_m, robot->held_torque_N_m, sizeof torque_N_m);
    const omni_twist_t floor = omni_rotate_to_body(&out->reference.rate, &tick->heading);
    omni_kinematics_inverse(&c->kinematics, &floor, NULL, out->wheel_reference);
    out->wheel_scale = omni_direct_torque_protect(&c->torque, &c->kinematics, &floor, out->wheel_rad_s, torque_N_m);
    out->duty_scale = robot->held_scale * torque_duties(c, torque_N_m, out);
}

static void open_loop(const omni_robot_config_t *c, omni_tick_t *tick) {
    omni_outputs_t *out = tick->out;
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        out->duty[i] = tick->in->setpoint.duty[i];
    }
    out->duty_scale = omni_saturate_direction(out->duty, c->kinematics.wheels, c->wheel_speed.duty_limit);
    for (uint8_t i = 0; i < c->kinematics.wheels; ++i) {
        out->voltage_V[i] = out->duty[i] * out->supply_V;
    }
}

static bool is_off_track(const omni_robot_config_t *c, const omni_control_terms_t *terms) {
    const omni_real_t distance2 = terms->error[0] * terms->error[0] + terms->error[1] * terms->error[1];
    return distance2 > c->limits.error_m * c->limits.error_m || omni_absf(terms->error[2]) > c->limits.error_rad;
}

static uint8_t driver_of(const omni_robot_config_t *c, const omni_tick_t *tick) {
    if (tick->kind == OMNI_SETPOINT_DUTY) {
        return OMNI_DRIVER_DUTY;
    }
    if (tick->position_loop && c->controller == OMNI_CTL_MODE_ORIGINAL) {
        return OMNI_DRIVER_ORIGINAL;
    }
    return tick->position_loop && c->controller == OMNI_CTL_MODE_TORQUE ? OMNI_DRIVER_TORQUE : OMNI_DRIVER_LOOPS;
}

/* Integrals of loops that did not drive the robot in the last tick are of another time: with them the wheels would jerk. */
static void hand_over(omni_robot_t *robot, const omni_tick_t *tick, uint8_t driver) {
    if (robot->config->controller != robot->last_controller || !tick->position_loop) {
        omni_ismc_reset(&robot->ismc);
        omni_fl_reset(&robot->fl);
        robot->control_ticks = 0;
    }
    if (driver != robot->last_driver) {
        omni_original_reset(&robot->original);
        omni_wheel_speed_reset(&robot->wheel_speed);
        robot->saturated = false;
    }
    robot->last_driver = driver;
}

void omni_robot_control(omni_robot_t *robot, omni_tick_t *tick) {
    const omni_robot_config_t *c = robot->config;
    omni_outputs_t *out = tick->out;
    out->wheel_scale = 1.0f;
    out->duty_scale = 1.0f;
    if (robot->state != OMNI_STATE_ARMED) {
        robot->saturated = false;
        return;
    }
    hand_over(robot, tick, driver_of(c, tick));
    switch (robot->last_driver) {
    case OMNI_DRIVER_DUTY:
        open_loop(c, tick);
        break;
    case OMNI_DRIVER_ORIGINAL:
        original_law(robot, tick);
        break;
    case OMNI_DRIVER_TORQUE:
        torque_control(robot, tick);
        break;
    default:
        wheel_references(robot, tick);
        break;
    }
    robot->saturated = out->wheel_scale < 1.0f || out->duty_scale < 1.0f;
    robot->off_track = tick->position_loop && is_off_track(c, &out->terms);
}
