/* SPDX-License-Identifier: MIT */
#include "../math/math_inline.h"
#include "trajectory_internal.h"

/* A 32-bit mixing function: every input bit reaches every output bit (the finaliser of MurmurHash3, public domain). */
static uint32_t mix_bits(uint32_t h) {
    h ^= h >> 16;
    h *= 0x85ebca6bu;
    h ^= h >> 13;
    h *= 0xc2b2ae35u;
    h ^= h >> 16;
    return h;
}

/* Uniform in [-1, 1), exact in a float. */
static omni_real_t uniform_draw(uint32_t seed, uint32_t index) {
    const uint32_t bits = mix_bits(mix_bits(seed + 0x9e3779b9u) ^ mix_bits(index + 1u)) >> 8;
    return (omni_real_t)bits / 8388608.0f - 1.0f;
}

static omni_pose_t draw_point(const omni_trajectory_config_t *c, uint32_t point) {
    omni_pose_t pose;
    pose.x = c->size_m * uniform_draw(c->seed, 3 * point);
    pose.y = c->size_m * uniform_draw(c->seed, 3 * point + 1);
    pose.theta = c->rotation_amplitude_rad * uniform_draw(c->seed, 3 * point + 2);
    return pose;
}

void omni_path_points(omni_trajectory_t *plan, const omni_waypoints_t *given) {
    omni_waypoints_t *points = &plan->waypoints;
    const uint8_t source = omni_path_row(plan)->points;
    if (source == OMNI_POINTS_DRAWN) {
        points->count = OMNI_MAX_WAYPOINTS;
        for (uint32_t i = 0; i < OMNI_MAX_WAYPOINTS; ++i) {
            points->pose[i] = draw_point(&plan->config, i);
        }
    } else if (source != OMNI_POINTS_NONE) {
        *points = *given;
    }
    for (uint8_t i = 1; i < points->count; ++i) {
        const omni_real_t before = points->pose[i - 1].theta;
        points->pose[i].theta = before + omni_wrap_pi(points->pose[i].theta - before);
    }
    if (source == OMNI_POINTS_SMOOTH) {
        omni_path_spline(plan);
    }
}
