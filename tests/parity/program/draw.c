/* SPDX-License-Identifier: MIT */
#include "draw.h"

#include <string.h>

#include "omni/math.h"

static omni_real_t whole_between(random_t *random, omni_real_t low, omni_real_t high) {
    return low + (omni_real_t)random_below(random, (uint32_t)(high - low) + 1u);
}

static omni_real_t draw_near(random_t *random, const omni_param_info_t *info, omni_real_t value) {
    const omni_real_t factor = random_between(random, 0.5f, 2.0f);
    if (info->kind == OMNI_PARAM_INT) {
        return value;
    }
    return omni_clampf(value * factor, info->minimum, info->maximum);
}

static omni_real_t draw_anywhere(random_t *random, const omni_param_info_t *info) {
    switch (random_below(random, 4)) {
    case 0:
        return info->minimum;
    case 1:
        return info->maximum;
    default:
        break;
    }
    if (info->kind == OMNI_PARAM_INT) {
        return whole_between(random, info->minimum, info->maximum);
    }
    /* Most ranges span decades: small values more often than large ones. */
    const omni_real_t unit = random_between(random, 0.0f, 1.0f);
    return info->minimum + unit * unit * unit * (info->maximum - info->minimum);
}

/* How the motors are wired is none of the core's business. */
static bool is_wiring(uint32_t index) {
    const bool channel = index >= OMNI_PARAM_W1_IN1_CH && index < OMNI_PARAM_W1_IN2_CH + OMNI_MAX_WHEELS;
    return channel || index == OMNI_PARAM_MOT_DRIVER;
}

/* Drawn by draw_gyro, from numbers of its own: robots without one see what they would see if there were none. */
static bool is_gyro(uint32_t index) {
    return index >= OMNI_PARAM_GYRO_AXIS && index <= OMNI_PARAM_GYRO_S_SD;
}

/* Drawn by current_draw, in the same way. */
static bool is_current(uint32_t index) {
    return index >= OMNI_PARAM_LIM_I && index <= OMNI_PARAM_SAFE_I_TC;
}

/* Drawn by flow_draw, in the same way. */
static bool is_flow(uint32_t index) {
    return index >= OMNI_PARAM_FLOW_MODE && index <= OMNI_PARAM_FLOW_GATE;
}

static bool is_left_out(uint32_t index) {
    return is_wiring(index) || is_gyro(index) || is_current(index) || is_flow(index);
}

/* Any parameter that the core may read: one that tells of the wiring more or less changes no draw. */
static uint32_t draw_index(random_t *random) {
    uint32_t others = 0;
    for (uint32_t i = 0; i < OMNI_PARAM_COUNT; ++i) {
        others += !is_left_out(i);
    }
    uint32_t left = random_below(random, others);
    uint32_t index = 0;
    while (is_left_out(index) || left > 0) {
        left -= !is_left_out(index);
        ++index;
    }
    return index;
}

static void draw_value(random_t *random, draw_style_t style, uint32_t index, omni_real_t *values) {
    const omni_param_info_t *info = &omni_param_table[index];
    values[index] = style == DRAW_NEAR ? draw_near(random, info, values[index]) : draw_anywhere(random, info);
}

/* Paths short enough that an episode sees their ends. */
static void draw_path(random_t *random, uint32_t number, omni_real_t *values) {
    const uint32_t types = OMNI_TRJ_TYPE_COUNT;
    values[OMNI_PARAM_TRJ_TYPE] = (omni_real_t)(number % types);
    values[OMNI_PARAM_TRJ_ROT] = (omni_real_t)(number / types % (OMNI_TRJ_ROT_TANGENT + 1));
    values[OMNI_PARAM_TRJ_SIZE] = random_between(random, 0.05f, 0.6f);
    values[OMNI_PARAM_TRJ_PETALS] = whole_between(random, 1.0f, 9.0f);
    values[OMNI_PARAM_TRJ_PERIOD] = random_between(random, 0.5f, 4.0f);
    values[OMNI_PARAM_TRJ_LAPS] = random_chance(random, 500000) ? random_between(random, 0.0f, 2.0f) : 0.0f;
    values[OMNI_PARAM_TRJ_ROT_N] = whole_between(random, 0.0f, 3.0f);
    values[OMNI_PARAM_TRJ_SEED] = whole_between(random, 0.0f, 1000.0f);
    values[OMNI_PARAM_TRJ_RAMP] = random_between(random, 0.0f, 0.5f);
    values[OMNI_PARAM_TRJ_SCALE] = random_chance(random, 800000) ? 1.0f : 0.0f;
}

void draw_parameters(random_t *random, uint32_t number, draw_style_t style, omni_real_t *values) {
    const omni_builtin_robot_t *robot = &omni_builtin_robots[random_below(random, (uint32_t)omni_builtin_robot_count)];
    memcpy(values, robot->values, sizeof robot->values);
    const uint32_t changes = style == DRAW_OWN ? 0 : random_below(random, style == DRAW_NEAR ? 30 : 6);
    for (uint32_t i = 0; i < changes; ++i) {
        draw_value(random, style, draw_index(random), values);
    }
    values[OMNI_PARAM_CTL_MODE] = (omni_real_t)(number % OMNI_CTL_MODE_COUNT);
    values[OMNI_PARAM_CTL_PERIOD] = random_chance(random, 700000) ? 1.0f : whole_between(random, 2.0f, 100.0f);
    values[OMNI_PARAM_KF_MODE] = whole_between(random, OMNI_KF_MODE_OFF, OMNI_KF_MODE_ANGLE);
    values[OMNI_PARAM_EKF_MODE] = whole_between(random, OMNI_EKF_MODE_ODOMETRY, OMNI_EKF_MODE_SLIP);
    values[OMNI_PARAM_ISMC_SWITCH] = whole_between(random, OMNI_ISMC_SWITCH_SIGN, OMNI_ISMC_SWITCH_SUPER_TWISTING);
    if (random_chance(random, 300000)) { /* a gain that does not cover the slip */
        values[OMNI_PARAM_ISMC_K_XY] = random_between(random, 0.0f, 0.01f);
        values[OMNI_PARAM_ISMC_K_TH] = random_between(random, 0.0f, 0.03f);
    }
    if (random_chance(random, 200000)) { /* a fence that the robot meets */
        values[OMNI_PARAM_LIM_POS] = random_between(random, 0.1f, 0.5f);
    }
    if (number % 8 == 5) { /* wheels that turn faster than they are asked to, and nothing holds them back */
        values[OMNI_PARAM_WS_P] = 0.0f;
        values[OMNI_PARAM_WS_I] = 0.0f;
        values[OMNI_PARAM_WS_FF] = 1.5f;
    }
    values[OMNI_PARAM_EKF_GATE_N] = whole_between(random, 1.0f, 30.0f);
    values[OMNI_PARAM_SAFE_LINK_TO] = random_between(random, 0.2f, 1.0f);
    values[OMNI_PARAM_SAFE_CMD_TO] = random_between(random, 0.05f, 0.5f);
    values[OMNI_PARAM_SAFE_STALL_T] = random_between(random, 0.02f, 0.4f);
    values[OMNI_PARAM_FIX_TIMEOUT] = random_between(random, 0.05f, 0.5f);
    values[OMNI_PARAM_DT_GRIP] = random_chance(random, 500000) ? random_between(random, 0.05f, 1.0f) : 0.0f;
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        values[OMNI_PARAM_W1_ENC_DIR + i] = random_chance(random, 500000) ? 1.0f : -1.0f;
        values[OMNI_PARAM_W1_MOT_DIR + i] = random_chance(random, 500000) ? 1.0f : -1.0f;
    }
    draw_path(random, number / 2, values);
}

void draw_change(random_t *random, omni_real_t *values) {
    const uint32_t changes = 1 + random_below(random, 3);
    for (uint32_t i = 0; i < changes; ++i) {
        const uint32_t index = draw_index(random);
        if (omni_param_table[index].locked_while_armed == 0) {
            draw_value(random, random_chance(random, 700000) ? DRAW_NEAR : DRAW_ANYWHERE, index, values);
        }
    }
    if (random_chance(random, 300000)) {
        values[OMNI_PARAM_CTL_MODE] = whole_between(random, 0, OMNI_CTL_MODE_COUNT - 1);
    }
}

void draw_setpoint(random_t *random, const omni_pose_t *at, omni_setpoint_t *setpoint) {
    const omni_real_t reach = random_chance(random, 50000) ? 40.0f : 0.3f;
    const omni_real_t speed = random_chance(random, 50000) ? 1e4f : 0.2f;
    setpoint->kind = (uint8_t)random_below(random, OMNI_SETPOINT_DUTY + 1);
    setpoint->pose.x = at->x + random_between(random, -reach, reach);
    setpoint->pose.y = at->y + random_between(random, -reach, reach);
    setpoint->pose.theta = at->theta + random_between(random, -3.0f, 3.0f);
    setpoint->twist.vx = random_between(random, -speed, speed);
    setpoint->twist.vy = random_between(random, -speed, speed);
    setpoint->twist.wz = random_between(random, -speed, speed) * 4.0f;
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        setpoint->duty[i] = random_between(random, -1.2f, 1.2f);
    }
}

void draw_waypoints(random_t *random, omni_waypoints_t *waypoints) {
    waypoints->count = (uint8_t)(2 + random_below(random, OMNI_MAX_WAYPOINTS - 1));
    for (int i = 0; i < waypoints->count; ++i) {
        waypoints->pose[i].x = random_between(random, -0.5f, 0.5f);
        waypoints->pose[i].y = random_between(random, -0.5f, 0.5f);
        waypoints->pose[i].theta = random_between(random, -4.0f, 4.0f);
    }
}
