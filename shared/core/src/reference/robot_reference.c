/* SPDX-License-Identifier: MIT */
#include "../control/controllers.h"
#include "../model/kinematics_inline.h"
#include "omni/saturation.h"

/* Largest rate at which the reference approaches a pose setpoint, 1/s: near it the speed is this times the distance. */
static const omni_real_t POSE_APPROACH_RATE = 3.0f;

/* Limit a body twist to the speed limits and to `share` of the wheel speed limit by one factor. Reported in `target`.
 */
static omni_twist_t limit_twist(const omni_robot_config_t *c, omni_twist_t body, omni_real_t share,
                                omni_target_t *target) {
    const omni_real_t speed = omni_sqrtf(body.vx * body.vx + body.vy * body.vy);
    omni_real_t wheel[OMNI_MAX_WHEELS] = {0};
    omni_kinematics_inverse(&c->kinematics, &body, NULL, wheel);
    omni_real_t scale = omni_saturate_direction(wheel, c->kinematics.wheels, share * c->limits.wheel_rad_s);
    const omni_uint_t by_wheel = omni_select(scale < 1.0f, (uint32_t)OMNI_LIMIT_WHEEL, 0u);
    const omni_uint_t by_speed = omni_select(speed * scale > c->limits.speed_m_s, (uint32_t)OMNI_LIMIT_SPEED, 0u);
    scale = omni_select(speed * scale > c->limits.speed_m_s, c->limits.speed_m_s / speed, scale);
    const omni_uint_t by_turn =
        omni_select(omni_absf(body.wz) * scale > c->limits.turn_rad_s, (uint32_t)OMNI_LIMIT_TURN, 0u);
    scale = omni_select(omni_absf(body.wz) * scale > c->limits.turn_rad_s, c->limits.turn_rad_s / omni_absf(body.wz),
                        scale);
    target->velocity_scale = scale;
    target->velocity_limits = by_wheel | by_speed | by_turn;
    return (omni_twist_t){body.vx * scale, body.vy * scale, body.wz * scale};
}

/* Move `from` towards `to`, speed by at most `step`, turn rate by at most `turn_step`. */
static omni_twist_t approach_twist(omni_twist_t from, omni_twist_t to, omni_real_t step, omni_real_t turn_step) {
    const omni_real_t dx = to.vx - from.vx;
    const omni_real_t dy = to.vy - from.vy;
    const omni_real_t distance = omni_sqrtf(dx * dx + dy * dy);
    const omni_real_t share = omni_select(distance > step, step / distance, 1.0f);
    from.vx += dx * share;
    from.vy += dy * share;
    from.wz += omni_clampf(to.wz - from.wz, -turn_step, turn_step);
    return from;
}

/* Speed per distance, 1/s, that comes to rest at distance 0 with at most `acceleration`. Near the setpoint it is
 * constant, and the deceleration is this rate times the speed; further away v^2 = 2 a (d - d0 / 2), which meets it at
 * distance d0. */
static omni_real_t approach_rate(omni_real_t distance, omni_real_t acceleration) {
    const omni_real_t proportional = acceleration / (POSE_APPROACH_RATE * POSE_APPROACH_RATE);
    const omni_real_t d = omni_maxf(distance, proportional);
    return omni_sqrtf(acceleration * (2.0f * d - proportional)) / d;
}

/* Yaw acceleration limit, rad/s^2: the rim accelerates like the centre. */
static omni_real_t turn_acceleration(const omni_robot_config_t *c) {
    const omni_real_t lever_arm_m = omni_lever_arm_m(&c->kinematics);
    return c->limits.acceleration_m_s2 / (lever_arm_m > 0.0f ? lever_arm_m : 1.0f);
}

/* Ramp `reference_rate` towards the demand within LIM_A. @return the acceleration. */
static omni_twist_t ramp_velocity(omni_reference_generator_t *generator, const omni_robot_config_t *c,
                                  omni_twist_t demand) {
    const omni_real_t step = c->limits.acceleration_m_s2 * c->step_s;
    const omni_real_t turn_step = turn_acceleration(c) * c->step_s;
    const omni_twist_t before = generator->reference_rate;
    generator->reference_rate = approach_twist(before, demand, step, turn_step);
    const omni_real_t rate = 1.0f / c->step_s;
    return (omni_twist_t){(generator->reference_rate.vx - before.vx) * rate,
                          (generator->reference_rate.vy - before.vy) * rate,
                          (generator->reference_rate.wz - before.wz) * rate};
}

/* Reference at rest at a pose. */
static void set_standing_reference(omni_target_t *target, const omni_pose_t *pose) {
    const omni_twist_t rest = {0.0f, 0.0f, 0.0f};
    target->reference.pose = *pose;
    target->reference.rate = rest;
    target->reference.acceleration = rest;
    target->reference.path_time_s = 0.0f;
    target->reference.phase = OMNI_PHASE_NONE;
}

/* Reference that approaches a pose setpoint within the limits and follows its rate. */
static void approach_pose_setpoint(omni_reference_generator_t *generator, const omni_robot_config_t *c,
                                   const omni_inputs_t *inputs, omni_target_t *target) {
    const omni_setpoint_t *setpoint = &inputs->setpoint;
    omni_pose_t *pose = &generator->reference_pose;
    const omni_real_t age = omni_robot_age_s(inputs->time_us, setpoint->time_us);
    const omni_real_t dx = setpoint->pose.x + setpoint->twist.vx * age - pose->x;
    const omni_real_t dy = setpoint->pose.y + setpoint->twist.vy * age - pose->y;
    const omni_real_t dtheta = omni_wrap_pi(setpoint->pose.theta + setpoint->twist.wz * age - pose->theta);
    /* One rate for all three, so that way and turn end together. */
    const omni_real_t of_way = approach_rate(omni_sqrtf(dx * dx + dy * dy), c->limits.acceleration_m_s2);
    const omni_real_t of_turn = approach_rate(omni_absf(dtheta), turn_acceleration(c));
    const omni_real_t rate = omni_minf(of_way, of_turn);
    const omni_twist_t wanted = {setpoint->twist.vx + rate * dx, setpoint->twist.vy + rate * dy,
                                 setpoint->twist.wz + rate * dtheta};
    const omni_rotation_t heading = omni_rotation(pose->theta);
    const omni_twist_t body = omni_rotate_to_body(&wanted, &heading);
    const omni_twist_t limited = limit_twist(c, body, c->limits.wheel_speed_fraction, target);
    omni_reference_t *reference = &target->reference;
    reference->acceleration = ramp_velocity(generator, c, omni_rotate_to_world(&limited, &heading));
    pose->x += generator->reference_rate.vx * c->step_s;
    pose->y += generator->reference_rate.vy * c->step_s;
    pose->theta += generator->reference_rate.wz * c->step_s;
    reference->pose = *pose;
    reference->rate = generator->reference_rate;
    reference->path_time_s = 0.0f;
    reference->phase = OMNI_PHASE_NONE;
    target->position_loop = true;
}

static void hold_pose(omni_reference_generator_t *generator, omni_target_t *target) {
    generator->reference_rate = (omni_twist_t){0.0f, 0.0f, 0.0f};
    set_standing_reference(target, &generator->reference_pose);
    target->position_loop = true;
}

/* A velocity setpoint has no pose reference: the pose to hold afterwards is the estimate. */
static void follow_velocity(omni_reference_generator_t *generator, const omni_robot_config_t *c,
                            const omni_twist_t *twist, const omni_estimate_t *estimate, omni_target_t *target) {
    const bool world = target->kind == OMNI_SETPOINT_VELOCITY_WORLD;
    const omni_twist_t body = world ? omni_rotate_to_body(twist, &estimate->heading) : *twist;
    const omni_twist_t body_acceleration = ramp_velocity(generator, c, limit_twist(c, body, 1.0f, target));
    target->body_rate = generator->reference_rate;
    generator->reference_pose = estimate->pose;
    target->reference.pose = estimate->pose;
    target->reference.path_time_s = 0.0f;
    target->reference.phase = OMNI_PHASE_NONE;
    target->reference.rate = omni_rotate_to_world(&generator->reference_rate, &estimate->heading);
    target->reference.acceleration = omni_rotate_to_world(&body_acceleration, &estimate->heading);
}

/* A velocity of zero that has grown old, and the ramp has reached it. The pose where the robot came to rest is held. */
static bool has_come_to_rest(const omni_reference_generator_t *generator, const omni_robot_config_t *c,
                             const omni_inputs_t *inputs) {
    const omni_twist_t *rate = &generator->reference_rate;
    return omni_robot_age_s(inputs->time_us, inputs->setpoint.time_us) > c->limits.command_timeout_s &&
           omni_absf(rate->vx) + omni_absf(rate->vy) + omni_absf(rate->wz) <= 0.0f;
}

static void follow_trajectory(omni_reference_generator_t *generator, const omni_inputs_t *inputs,
                              omni_target_t *target) {
    omni_reference_t *reference = &target->reference;
    omni_trajectory_evaluate(generator->trajectory, inputs->time_us - generator->trajectory_start_us, reference);
    generator->reference_pose = reference->pose;
    generator->reference_rate = reference->rate;
    target->position_loop = true;
}

static bool is_velocity(uint8_t kind) {
    return kind == OMNI_SETPOINT_VELOCITY_BODY || kind == OMNI_SETPOINT_VELOCITY_WORLD;
}

static bool has_rate(uint8_t kind) {
    return kind == OMNI_SETPOINT_POSE || kind == OMNI_SETPOINT_TRAJECTORY;
}

/* On a change of the setpoint's kind: continue from the rate of the last reference, converted to the new frame; after
 * open-loop duties from the estimated rate. */
static void convert_rate_on_takeover(omni_reference_generator_t *generator, const omni_estimate_t *estimate,
                                     uint8_t kind) {
    const omni_real_t theta = estimate->pose.theta;
    const bool body = is_velocity(kind);
    if (generator->last_kind == OMNI_SETPOINT_DUTY) {
        generator->reference_rate = body ? omni_twist_to_body(&estimate->rate, theta) : estimate->rate;
    } else if (is_velocity(generator->last_kind) && !body) {
        generator->reference_rate = omni_twist_to_world(&generator->reference_rate, theta);
    } else if (has_rate(generator->last_kind) && body) {
        generator->reference_rate = omni_twist_to_body(&generator->reference_rate, theta);
    }
}

/* Reference at rest at the estimate; also the pose to hold afterwards. */
static void set_reference_to_estimate(omni_reference_generator_t *generator, const omni_estimate_t *estimate,
                                      omni_target_t *target) {
    generator->reference_pose = estimate->pose;
    set_standing_reference(target, &estimate->pose);
}

void omni_robot_reference_events(omni_reference_generator_t *generator, const omni_inputs_t *inputs,
                                 const omni_estimate_t *estimate) {
    if ((inputs->events & OMNI_EVENT_TRAJECTORY_START) != 0 && inputs->trajectory != NULL) {
        generator->trajectory = inputs->trajectory;
        generator->trajectory_start_us = inputs->time_us;
    }
    if ((inputs->events & OMNI_EVENT_TRAJECTORY_STOP) != 0) {
        generator->trajectory = NULL;
        generator->reference_pose = estimate->pose;
    }
}

void omni_robot_reference_arm(omni_reference_generator_t *generator, const omni_inputs_t *inputs,
                              const omni_estimate_t *estimate) {
    generator->reference_pose = estimate->pose;
    generator->reference_rate = (omni_twist_t){0.0f, 0.0f, 0.0f};
    generator->trajectory_start_us = inputs->time_us;
}

static void follow_setpoint(omni_reference_generator_t *generator, const omni_robot_config_t *c,
                            const omni_inputs_t *inputs, const omni_estimate_t *estimate, omni_target_t *target) {
    switch (target->kind) {
    case OMNI_SETPOINT_POSE:
        approach_pose_setpoint(generator, c, inputs, target);
        if (omni_robot_age_s(inputs->time_us, inputs->setpoint.time_us) > c->limits.command_timeout_s) {
            target->kind = OMNI_SETPOINT_NONE; /* its stream has ended there: the pose is held */
        }
        break;
    case OMNI_SETPOINT_VELOCITY_BODY:
    case OMNI_SETPOINT_VELOCITY_WORLD:
        if (has_come_to_rest(generator, c, inputs)) {
            target->kind = OMNI_SETPOINT_NONE;
            hold_pose(generator, target);
        } else {
            follow_velocity(generator, c, &inputs->setpoint.twist, estimate, target);
        }
        break;
    case OMNI_SETPOINT_TRAJECTORY:
        follow_trajectory(generator, inputs, target);
        break;
    case OMNI_SETPOINT_DUTY:
        set_reference_to_estimate(generator, estimate, target);
        break;
    default:
        hold_pose(generator, target);
        break;
    }
}

void omni_robot_reference(omni_reference_generator_t *generator, const omni_robot_config_t *config,
                          const omni_inputs_t *inputs, const omni_estimate_t *estimate, uint8_t kind,
                          omni_target_t *target) {
    target->body_rate = (omni_twist_t){0.0f, 0.0f, 0.0f};
    target->velocity_scale = 1.0f;
    target->velocity_limits = 0u;
    target->position_loop = false;
    target->kind = kind;
    if (!target->armed || (kind == OMNI_SETPOINT_TRAJECTORY && generator->trajectory == NULL)) {
        target->kind = OMNI_SETPOINT_NONE; /* not armed; no trajectory was started, or this tick's events stopped it */
    }
    if (!target->armed) {
        set_reference_to_estimate(generator, estimate, target);
    } else {
        if (target->kind != generator->last_kind) {
            convert_rate_on_takeover(generator, estimate, target->kind);
        }
        follow_setpoint(generator, config, inputs, estimate, target);
        if (omni_controllers[config->controller]->demand == OMNI_DEMAND_NONE) {
            target->position_loop = false;
            target->body_rate = omni_twist_to_body(&target->reference.rate, target->reference.pose.theta);
        }
    }
    generator->last_kind = target->kind;
}
