/* SPDX-License-Identifier: MIT */
/* When a share of the configured path is driven. */
#include <string.h>

#include "hil_sim/player.h"

/* Padding may differ in what is equal otherwise: that costs a plan and nothing else. */
static bool same_bytes(const void *one, const void *other, size_t size) {
    return memcmp(one, other, size) == 0;
}

static void plan_path(hil_path_t *path, const omni_robot_config_t *config) {
    const omni_pose_t origin = {0.0f, 0.0f, 0.0f};
    memcpy(&path->config, &config->trajectory, sizeof path->config);
    memcpy(&path->kinematics, &config->kinematics, sizeof path->kinematics);
    path->known = true;
    if (omni_trajectory_plan(&path->plan, &path->config, &path->kinematics, NULL, &origin) == OMNI_OK) {
        const omni_pose_t start = path->plan.start;
        (void)omni_trajectory_plan(&path->plan, &path->config, &path->kinematics, NULL, &start);
    }
}

static bool driven(const omni_trajectory_t *plan, uint64_t ticks, double share) {
    omni_reference_t reference;
    omni_trajectory_evaluate(plan, ticks * OMNI_TICK_US, &reference);
    return reference.phase == OMNI_PHASE_DONE || (double)reference.path_time_s >= share * (double)plan->duration_s;
}

uint64_t hil_path_ticks(hil_path_t *path, const omni_robot_config_t *config, double share) {
    if (!path->known || !same_bytes(&path->config, &config->trajectory, sizeof path->config) ||
        !same_bytes(&path->kinematics, &config->kinematics, sizeof path->kinematics)) {
        plan_path(path, config);
    }
    if (path->plan.duration_s < 0.0f) {
        return UINT64_MAX;
    }
    uint64_t low = 0;
    uint64_t high = 1;
    while (!driven(&path->plan, high, share)) {
        low = high;
        high *= 2;
    }
    while (high - low > 1) {
        const uint64_t middle = (low + high) / 2;
        const bool enough = driven(&path->plan, middle, share);
        low = enough ? low : middle;
        high = enough ? middle : high;
    }
    return high;
}
