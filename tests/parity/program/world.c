/* SPDX-License-Identifier: MIT */
#include "world.h"

#include <string.h>

#include "omni/math.h"

static const omni_real_t response = 0.03f; /* of a motor per tick */

void world_reset(world_t *world, random_t *random, const omni_pose_t *pose) {
    memset(world, 0, sizeof *world);
    world->pose = *pose;
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        const uint32_t counter = random_u32(random);
        memcpy(&world->counts[i], &counter, sizeof counter);
    }
}

static void turn(world_t *world, const omni_robot_config_t *config, int wheel, omni_real_t turned_rad) {
    const omni_real_t counts = omni_clampf(turned_rad / config->rad_per_count, -1e6f, 1e6f) + world->part[wheel];
    const int32_t whole = (int32_t)counts;
    world->part[wheel] = counts - (omni_real_t)whole;
    const uint32_t moved = (uint32_t)(config->encoder_direction[wheel] < 0 ? -whole : whole);
    const uint32_t counter = (uint32_t)world->counts[wheel] + moved;
    memcpy(&world->counts[wheel], &counter, sizeof counter);
}

void world_step(world_t *world, const omni_robot_config_t *config, const omni_real_t *voltage_V, uint64_t now_us) {
    const omni_real_t per_V = 1.0f / omni_motor_speed_gain(&config->motor);
    omni_real_t rolled_rad[OMNI_MAX_WHEELS] = {0.0f};
    for (int i = 0; i < config->kinematics.wheels; ++i) {
        const omni_real_t target = omni_clampf(voltage_V[i] * per_V, -1e4f, 1e4f);
        world->speed_rad_s[i] += (target - world->speed_rad_s[i]) * response;
        world->speed_rad_s[i] = world->blocked[i] ? 0.0f : world->speed_rad_s[i];
        const omni_real_t turned_rad = world->speed_rad_s[i] * config->step_s;
        turn(world, config, i, turned_rad);
        rolled_rad[i] = turned_rad * (1.0f - world->slip[i]);
    }
    omni_twist_t body;
    omni_kinematics_forward(&config->kinematics, rolled_rad, NULL, &body);
    const omni_twist_t moved = omni_twist_to_world(&body, world->pose.theta);
    world->pose.x = omni_clampf(world->pose.x + moved.vx, -1e3f, 1e3f);
    world->pose.y = omni_clampf(world->pose.y + moved.vy, -1e3f, 1e3f);
    world->pose.theta = omni_wrap_pi(world->pose.theta + omni_clampf(moved.wz, -3.0f, 3.0f));
    ++world->tick;
    world->history[world->tick % WORLD_HISTORY] = world->pose;
    world->time_us[world->tick % WORLD_HISTORY] = now_us;
}

omni_pose_t world_pose(const world_t *world, uint32_t ago, uint64_t *time_us) {
    const uint32_t slot = (world->tick - ago) % WORLD_HISTORY;
    *time_us = world->time_us[slot];
    return world->history[slot];
}
