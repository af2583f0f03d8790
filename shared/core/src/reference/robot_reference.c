/* SPDX-License-Identifier: MIT */
#include "../control/controllers.h"
#include "../math/math_inline.h"
#include "omni/saturation.h"

/* How fast a governed reference closes in on its target, 1/s. */
static const omni_real_t GOVERNOR_RATE = 3.0f;

/* Scale a body twist so that it stays within the speed limits and `share` of the wheel speed limit, direction kept. The
 * target tells. */
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

/* Ramp towards the demand. @return the acceleration that takes. */
static omni_twist_t ramp_velocity(omni_guide_t *guide, const omni_robot_config_t *c, omni_twist_t demand) {
    const omni_real_t step = c->limits.acceleration_m_s2 * c->step_s;
    /* The rim accelerates like the centre: wz' = a / l. */
    const omni_real_t turn_step = step / (c->kinematics.b[0][2] > 0.0f ? c->kinematics.b[0][2] : 1.0f);
    const omni_twist_t before = guide->ramped;
    guide->ramped = approach_twist(before, demand, step, turn_step);
    const omni_real_t rate = 1.0f / c->step_s;
    return (omni_twist_t){(guide->ramped.vx - before.vx) * rate, (guide->ramped.vy - before.vy) * rate,
                          (guide->ramped.wz - before.wz) * rate};
}

/* A reference that stands at a pose. */
static void stand_at(omni_target_t *target, const omni_pose_t *pose) {
    const omni_twist_t rest = {0.0f, 0.0f, 0.0f};
    target->reference.pose = *pose;
    target->reference.rate = rest;
    target->reference.acceleration = rest;
    target->reference.path_time_s = 0.0f;
    target->reference.phase = OMNI_PHASE_NONE;
}

/* A pose set-point may be anywhere: the reference drives there itself, within the limits, and follows the set-point's
 * rate. */
static void govern_pose(omni_guide_t *guide, const omni_robot_config_t *c, const omni_inputs_t *inputs,
                        omni_target_t *target) {
    const omni_setpoint_t *setpoint = &inputs->setpoint;
    omni_pose_t *pose = &guide->governed;
    const omni_real_t age = omni_robot_age_s(inputs->time_us, setpoint->time_us);
    const omni_real_t dx = setpoint->pose.x + setpoint->twist.vx * age - pose->x;
    const omni_real_t dy = setpoint->pose.y + setpoint->twist.vy * age - pose->y;
    const omni_real_t dtheta = omni_wrap_pi(setpoint->pose.theta + setpoint->twist.wz * age - pose->theta);
    const omni_twist_t wanted = {setpoint->twist.vx + GOVERNOR_RATE * dx, setpoint->twist.vy + GOVERNOR_RATE * dy,
                                 setpoint->twist.wz + GOVERNOR_RATE * dtheta};
    const omni_rotation_t heading = omni_rotation(pose->theta);
    const omni_twist_t body = omni_rotate_to_body(&wanted, &heading);
    const omni_twist_t limited = limit_twist(c, body, c->limits.reference_share, target);
    omni_reference_t *reference = &target->reference;
    reference->acceleration = ramp_velocity(guide, c, omni_rotate_to_world(&limited, &heading));
    pose->x += guide->ramped.vx * c->step_s;
    pose->y += guide->ramped.vy * c->step_s;
    pose->theta += guide->ramped.wz * c->step_s;
    reference->pose = *pose;
    reference->rate = guide->ramped;
    reference->path_time_s = 0.0f;
    reference->phase = OMNI_PHASE_NONE;
    target->position_loop = true;
}

static void hold_pose(omni_guide_t *guide, omni_target_t *target) {
    guide->ramped = (omni_twist_t){0.0f, 0.0f, 0.0f};
    stand_at(target, &guide->governed);
    target->position_loop = true;
}

/* A velocity demand has no pose reference: what is held afterwards is wherever the robot is. */
static void follow_velocity(omni_guide_t *guide, const omni_robot_config_t *c, const omni_twist_t *twist,
                            const omni_estimate_t *estimate, omni_target_t *target) {
    const bool world = target->kind == OMNI_SETPOINT_VELOCITY_WORLD;
    const omni_twist_t body = world ? omni_rotate_to_body(twist, &estimate->heading) : *twist;
    const omni_twist_t body_acceleration = ramp_velocity(guide, c, limit_twist(c, body, 1.0f, target));
    target->body_rate = guide->ramped;
    guide->governed = estimate->pose;
    target->reference.pose = estimate->pose;
    target->reference.path_time_s = 0.0f;
    target->reference.phase = OMNI_PHASE_NONE;
    target->reference.rate = omni_rotate_to_world(&guide->ramped, &estimate->heading);
    target->reference.acceleration = omni_rotate_to_world(&body_acceleration, &estimate->heading);
}

/* A velocity of zero that has grown old, and the ramp has reached it. The pose where the robot came to rest is held. */
static bool has_come_to_rest(const omni_guide_t *guide, const omni_robot_config_t *c, const omni_inputs_t *inputs) {
    const omni_twist_t *ramped = &guide->ramped;
    return omni_robot_age_s(inputs->time_us, inputs->setpoint.time_us) > c->limits.command_timeout_s &&
           omni_absf(ramped->vx) + omni_absf(ramped->vy) + omni_absf(ramped->wz) <= 0.0f;
}

static void follow_trajectory(omni_guide_t *guide, const omni_inputs_t *inputs, omni_target_t *target) {
    omni_reference_t *reference = &target->reference;
    omni_trajectory_evaluate(guide->trajectory, inputs->time_us - guide->trajectory_start_us, reference);
    guide->governed = reference->pose;
    guide->ramped = reference->rate;
    target->position_loop = true;
}

static bool is_velocity(uint8_t kind) {
    return kind == OMNI_SETPOINT_VELOCITY_BODY || kind == OMNI_SETPOINT_VELOCITY_WORLD;
}

static bool has_rate(uint8_t kind) {
    return kind == OMNI_SETPOINT_POSE || kind == OMNI_SETPOINT_TRAJECTORY;
}

/* Another kind of set-point takes over from the speed that the last one had asked for; after open-loop duties from the
 * measured one. */
static void continue_from(omni_guide_t *guide, const omni_estimate_t *estimate, uint8_t kind) {
    const omni_real_t theta = estimate->pose.theta;
    const bool body = is_velocity(kind);
    if (guide->last_kind == OMNI_SETPOINT_DUTY) {
        guide->ramped = body ? omni_twist_to_body(&estimate->rate, theta) : estimate->rate;
    } else if (is_velocity(guide->last_kind) && !body) {
        guide->ramped = omni_twist_to_world(&guide->ramped, theta);
    } else if (has_rate(guide->last_kind) && body) {
        guide->ramped = omni_twist_to_body(&guide->ramped, theta);
    }
}

/* The robot stays where it is; what is held afterwards, too. */
static void stay_where_it_is(omni_guide_t *guide, const omni_estimate_t *estimate, omni_target_t *target) {
    guide->governed = estimate->pose;
    stand_at(target, &estimate->pose);
}

void omni_robot_guide_events(omni_guide_t *guide, const omni_inputs_t *inputs, const omni_estimate_t *estimate) {
    if ((inputs->events & OMNI_EVENT_TRAJECTORY_START) != 0 && inputs->trajectory != NULL) {
        guide->trajectory = inputs->trajectory;
        guide->trajectory_start_us = inputs->time_us;
    }
    if ((inputs->events & OMNI_EVENT_TRAJECTORY_STOP) != 0) {
        guide->trajectory = NULL;
        guide->governed = estimate->pose;
    }
}

void omni_robot_guide_arm(omni_guide_t *guide, const omni_inputs_t *inputs, const omni_estimate_t *estimate) {
    guide->governed = estimate->pose;
    guide->ramped = (omni_twist_t){0.0f, 0.0f, 0.0f};
    guide->trajectory_start_us = inputs->time_us;
}

static void follow_setpoint(omni_guide_t *guide, const omni_robot_config_t *c, const omni_inputs_t *inputs,
                            const omni_estimate_t *estimate, omni_target_t *target) {
    switch (target->kind) {
    case OMNI_SETPOINT_POSE:
        govern_pose(guide, c, inputs, target);
        break;
    case OMNI_SETPOINT_VELOCITY_BODY:
    case OMNI_SETPOINT_VELOCITY_WORLD:
        if (has_come_to_rest(guide, c, inputs)) {
            target->kind = OMNI_SETPOINT_NONE;
            hold_pose(guide, target);
        } else {
            follow_velocity(guide, c, &inputs->setpoint.twist, estimate, target);
        }
        break;
    case OMNI_SETPOINT_TRAJECTORY:
        follow_trajectory(guide, inputs, target);
        break;
    case OMNI_SETPOINT_DUTY:
        stay_where_it_is(guide, estimate, target);
        break;
    default:
        hold_pose(guide, target);
        break;
    }
}

void omni_robot_reference(omni_guide_t *guide, const omni_robot_config_t *config, const omni_inputs_t *inputs,
                          const omni_estimate_t *estimate, uint8_t kind, omni_target_t *target) {
    target->body_rate = (omni_twist_t){0.0f, 0.0f, 0.0f};
    target->velocity_scale = 1.0f;
    target->velocity_limits = 0u;
    target->position_loop = false;
    target->kind = kind;
    if (!target->armed || (kind == OMNI_SETPOINT_TRAJECTORY && guide->trajectory == NULL)) {
        target->kind = OMNI_SETPOINT_NONE; /* not armed; no trajectory was started, or this tick's events stopped it */
    }
    if (!target->armed) {
        stay_where_it_is(guide, estimate, target);
    } else {
        if (target->kind != guide->last_kind) {
            continue_from(guide, estimate, target->kind);
        }
        follow_setpoint(guide, config, inputs, estimate, target);
        if (omni_controllers[config->controller]->demand == OMNI_DEMAND_NONE) {
            target->position_loop = false;
            target->body_rate = omni_twist_to_body(&target->reference.rate, target->reference.pose.theta);
        }
    }
    guide->last_kind = target->kind;
}
