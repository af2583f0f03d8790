/* SPDX-License-Identifier: MIT */
/**
 * @file scene.h
 * A seeded stream of episodes that drives omni_robot_tick through everything it can do. It covers robots, parameters,
 * controllers, estimators, paths, set-points, events, and everything that can go wrong around it.
 */
#ifndef PARITY_SCENE_H
#define PARITY_SCENE_H

#include "current.h"
#include "flow.h"
#include "gyro.h"
#include "omni/robot.h"
#include "random.h"
#include "world.h"

/** What can go wrong, or happen, for some ticks. */
typedef enum scene_trouble_t {
    SCENE_COUNT_LOST = 0,
    SCENE_COUNT_JUMP,
    SCENE_TIME_JUMP,
    SCENE_TIME_BACK,
    SCENE_TIME_UNEVEN,
    SCENE_FIX_NAN,
    SCENE_FIX_JUMP,
    SCENE_FIX_TIME,
    SCENE_FIX_STOP,
    SCENE_BATTERY_SAG,
    SCENE_BATTERY_NAN,
    SCENE_DRIVER,
    SCENE_SETPOINT_NAN,
    SCENE_SETPOINT_STOP,
    SCENE_LINK_STOP,
    SCENE_OVERRUN,
    SCENE_BLOCKED,
    SCENE_SLIP,
    SCENE_DISARM,
    SCENE_ESTOP,
    SCENE_SET_POSE,
    SCENE_PATH_STOP,
    SCENE_TROUBLES
} scene_trouble_t;

typedef struct scene_t {
    random_t random;
    omni_robot_t robot;
    omni_robot_config_t configs[2];
    omni_trajectory_t plans[2];
    omni_real_t values[OMNI_PARAM_COUNT];
    omni_inputs_t inputs;
    omni_outputs_t outputs;
    world_t world;
    gyro_t gyro;
    flow_t flow;
    random_t current;       /**< of the current limit and the motors' heat */
    omni_pose_t fix_offset; /**< where the fixes say the world's origin is */
    uint64_t background;    /**< hash over what configuration and planning gave */
    uint64_t now_us;
    uint32_t tick;
    uint32_t episode;
    uint32_t episode_ends;
    uint32_t setpoint_ends;
    uint32_t fix_period;
    uint32_t fix_age;
    bool rough; /**< everything goes wrong, one thing after the other */
    uint16_t left[SCENE_TROUBLES];
    uint8_t config;
    uint8_t plan;
    uint32_t configs_refused;
    uint32_t plans_refused;
    uint32_t changes_while_armed;
} scene_t;

void scene_init(scene_t *scene, uint32_t seed);

/** One tick: think up its inputs and call omni_robot_tick. */
void scene_step(scene_t *scene);

#endif
