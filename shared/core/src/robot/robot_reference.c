/* SPDX-License-Identifier: MIT */
#include "robot_internal.h"

#include "../math/math_inline.h"
#include "omni/saturation.h"

/* How fast a governed reference closes in on its target, 1/s. */
static const omni_real_t GOVERNOR_RATE = 3.0f;

/* Scale a body twist so that it stays within the speed limits and `share` of the wheel speed limit, direction kept. */
static omni_twist_t limit_twist(const omni_robot_config_t *c, omni_twist_t body, omni_real_t share) {
    const omni_real_t speed = omni_sqrtf(body.vx * body.vx + body.vy * body.vy);
    omni_real_t wheel[OMNI_MAX_WHEELS] = {0};
    omni_kinematics_inverse(&c->kinematics, &body, NULL, wheel);
    omni_real_t scale = omni_saturate_direction(wheel, c->kinematics.wheels, share * c->limits.wheel_rad_s);
    scale = omni_select(speed * scale > c->limits.speed_m_s, c->limits.speed_m_s / speed, scale);
    scale = omni_select(omni_absf(body.wz) * scale > c->limits.turn_rad_s, c->limits.turn_rad_s / omni_absf(body.wz), scale);
    return (omni_twist_t){body.vx * scale, body.vy * scale, body.wz * scale};
}

/* Move `from` towards `to`, speed by at most `step`, turn rate by at most `turn_step`. */
static omni_twist_t approach(omni_twist_t from, omni_twist_t to, omni_real_t step, omni_real_t turn_step) {
    const omni_real_t dx = to.vx - from.vx;
    const omni_real_t dy = to.vy - from.vy;
    const omni_real_t distance = omni_sqrtf(dx * dx + dy * dy);
    const omni_real_t share = omni_select(distance > step, step / distance, 1.0f);
    from.vx += dx * share;
    from.vy += dy * share;
    from.wz += omni_clampf(to.wz - from.wz, -turn_step, turn_step);
    return from;
}

static omni_twist_t ramp(omni_robot_t *robot, omni_twist_t demand) {
    const omni_robot_config_t *c = robot->config;
    const omni_real_t step = c->limits.acceleration_m_s2 * c->step_s;
    /* The rim accelerates like the centre: wz' = a / l. */
    const omni_real_t turn_step = step / (c->kinematics.b[0][2] > 0.0f ? c->kinematics.b[0][2] : 1.0f);
    const omni_twist_t before = robot->ramped;
    robot->ramped = approach(before, demand, step, turn_step);
    const omni_real_t rate = 1.0f / c->step_s;
    return (omni_twist_t){(robot->ramped.vx - before.vx) * rate, (robot->ramped.vy - before.vy) * rate,
                          (robot->ramped.wz - before.wz) * rate};
}

/* A pose set-point may be anywhere: the reference drives there itself, within the limits, and follows the set-point's rate. */
static void govern_pose(omni_robot_t *robot, omni_tick_t *tick) {
    const omni_robot_config_t *c = robot->config;
    const omni_setpoint_t *setpoint = &tick->in->setpoint;
    omni_pose_t *pose = &robot->governed;
    const omni_real_t age = omni_robot_age_s(tick->in->time_us, setpoint->time_us);
    const omni_real_t dx = setpoint->pose.x + setpoint->twist.vx * age - pose->x;
    const omni_real_t dy = setpoint->pose.y + setpoint->twist.vy * age - pose->y;
    const omni_real_t dtheta = omni_wrap_pi(setpoint->pose.theta + setpoint->twist.wz * age - pose->theta);
    const omni_twist_t wanted = {setpoint->twist.vx + GOVERNOR_RATE * dx, setpoint->twist.vy + GOVERNOR_RATE * dy,
                                 setpoint->twist.wz + GOVERNOR_RATE * dtheta};
    const omni_rotation_t heading = omni_rotation(pose->theta);
    const omni_twist_t body = omni_rotate_to_body(&wanted, &heading);
    const omni_twist_t limited = limit_twist(c, body, c->limits.reference_share);
    omni_reference_t *reference = &tick->out->reference;
    reference->acceleration = ramp(robot, omni_rotate_to_world(&limited, &heading));
    pose->x += robot->ramped.vx * c->step_s;
    pose->y += robot->ramped.vy * c->step_s;
    pose->theta += robot->ramped.wz * c->step_s;
    reference->pose = *pose;
    reference->rate = robot->ramped;
    tick->position_loop = true;
}

static void hold(omni_robot_t *robot, omni_tick_t *tick) {
    robot->ramped = (omni_twist_t){0.0f, 0.0f, 0.0f};
    tick->out->reference.pose = robot->governed;
    tick->position_loop = true;
}

/* A velocity demand has no pose reference: what is held afterwards is wherever the robot is. */
static void follow_velocity(omni_robot_t *robot, omni_tick_t *tick) {
    const omni_robot_config_t *c = robot->config;
    const omni_twist_t *twist = &tick->in->setpoint.twist;
    const omni_twist_t body = tick->kind == OMNI_SETPOINT_VELOCITY_WORLD ? omni_rotate_to_body(twist, &tick->heading) : *twist;
    const omni_twist_t body_acceleration = ramp(robot, limit_twist(c, body, 1.0f));
    tick->body_rate = robot->ramped;
    robot->governed = tick->out->pose;
    tick->out->reference.pose = tick->out->pose;
    tick->out->reference.rate = omni_rotate_to_world(&robot->ramped, &tick->heading);
    tick->out->reference.acceleration = omni_rotate_to_world(&body_acceleration, &tick->heading);
}

static void follow_trajectory(omni_robot_t *robot, omni_tick_t *tick) {
    omni_reference_t *reference = &tick->out->reference;
    omni_trajectory_evaluate(robot->trajectory, tick->in->time_us - robot->trajectory_start_us, reference);
    robot->governed = reference->pose;
    robot->ramped = reference->rate;
    tick->position_loop = true;
}

static bool is_velocity(uint8_t kind) {
    return kind == OMNI_SETPOINT_VELOCITY_BODY || kind == OMNI_SETPOINT_VELOCITY_WORLD;
}

static bool has_rate(uint8_t kind) {
    return kind == OMNI_SETPOINT_POSE || kind == OMNI_SETPOINT_TRAJECTORY;
}

/* Another kind of set-point takes over from the speed that the last one had asked for; after open-loop duties from the measured one. */
static void continue_from(omni_robot_t *robot, const omni_tick_t *tick) {
    const omni_real_t theta = tick->out->pose.theta;
    const bool body = is_velocity(tick->kind);
    if (robot->last_kind == OMNI_SETPOINT_DUTY) {
        robot->ramped = body ? omni_twist_to_body(&tick->out->rate, theta) : tick->out->rate;
    } else if (is_velocity(robot->last_kind) && !body) {
        robot->ramped = omni_twist_to_world(&robot->ramped, theta);
    } else if (has_rate(robot->last_kind) && body) {
        robot->ramped = omni_twist_to_body(&robot->ramped, theta);
    }
}

void omni_robot_reference(omni_robot_t *robot, omni_tick_t *tick) {
    if (robot->state != OMNI_STATE_ARMED) {
        tick->out->reference.pose = tick->out->pose;
        robot->governed = tick->out->pose;
        robot->off_track = false;
        tick->kind = OMNI_SETPOINT_NONE;
        return;
    }
    if (tick->kind == OMNI_SETPOINT_TRAJECTORY && robot->trajectory == NULL) {
        tick->kind = OMNI_SETPOINT_NONE; /* none was started, or this tick's events stopped it */
    }
    if (tick->kind != robot->last_kind) {
        continue_from(robot, tick);
    }
    switch (tick->kind) {
    case OMNI_SETPOINT_POSE:
        govern_pose(robot, tick);
        break;
    case OMNI_SETPOINT_VELOCITY_BODY:
    case OMNI_SETPOINT_VELOCITY_WORLD:
        follow_velocity(robot, tick);
        break;
    case OMNI_SETPOINT_TRAJECTORY:
        follow_trajectory(robot, tick);
        break;
    case OMNI_SETPOINT_DUTY:
        robot->governed = tick->out->pose;
        tick->out->reference.pose = tick->out->pose;
        break;
    default:
        hold(robot, tick);
        break;
    }
    if (robot->config->controller == OMNI_CTL_MODE_NONE) {
        tick->position_loop = false;
        tick->body_rate = omni_twist_to_body(&tick->out->reference.rate, tick->out->reference.pose.theta);
    }
}
