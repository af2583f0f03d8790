/* SPDX-License-Identifier: MIT */
/**
 * @file world.h
 * Just enough of a robot to close the loop: first-order motors without slip, so that the estimators see plausible
 * motion. It is no model of anything; hil_sim is. All its numbers are the same on every machine.
 */
#ifndef PARITY_WORLD_H
#define PARITY_WORLD_H

#include "omni/robot.h"
#include "random.h"

enum { WORLD_HISTORY = 512 };

typedef struct world_t {
    omni_real_t speed_rad_s[OMNI_MAX_WHEELS];
    omni_real_t part[OMNI_MAX_WHEELS]; /**< of a count, -1..1 */
    int32_t counts[OMNI_MAX_WHEELS];
    omni_real_t slip[OMNI_MAX_WHEELS]; /**< share of a wheel's motion that the floor does not see */
    bool blocked[OMNI_MAX_WHEELS];
    omni_pose_t pose;
    omni_pose_t history[WORLD_HISTORY]; /**< pose of the last ticks */
    uint64_t time_us[WORLD_HISTORY];
    uint32_t tick;
} world_t;

/** At rest at `pose`, counters anywhere. */
void world_reset(world_t *world, random_t *random, const omni_pose_t *pose);

/** One tick under the voltages of the last one. */
void world_step(world_t *world, const omni_robot_config_t *config, const omni_real_t *voltage_V, uint64_t now_us);

/** Pose `ago` ticks before now, and when that was. */
omni_pose_t world_pose(const world_t *world, uint32_t ago, uint64_t *time_us);

#endif
