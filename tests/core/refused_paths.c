/* SPDX-License-Identifier: MIT */
/* Plans whose numbers fit no integer, most of them refused: built with a sanitizer, a conversion that overflows ends
 * this. */
#include <stdio.h>

#include "omni/omni.h"

static const omni_trajectory_config_t possible = {
    .type = OMNI_TRJ_TYPE_WAYPOINTS,
    .petals = 8,
    .size_m = 0.5f,
    .period_s = 20.0f,
    .laps = 1.0f,
    .margin = 0.8f,
    .ramp_s = 2.0f,
    .wheel_limit_rad_s = 3.0f,
    .voltage_limit_V = 12.0f,
    .ff_speed_V_s = 3.62f,
    .ff_acceleration_V_s2 = 0.0257f,
};

static int is_refused(const char *what, float voltage_limit_V, omni_pose_t at, omni_pose_t to) {
    const omni_kinematics_config_t layout = {
        3, {0.05f, 0.05f, 0.05f}, {0.26f, 0.26f, 0.26f}, {0.0f, 2.0943951f, 4.1887902f}};
    const omni_waypoints_t points = {2, {to, {0.1f, 0.0f, 0.0f}}};
    omni_trajectory_config_t config = possible;
    omni_kinematics_t k;
    omni_trajectory_t plan;
    config.voltage_limit_V = voltage_limit_V;
    const omni_result_t kinematics = omni_kinematics_init(&k, &layout);
    const omni_result_t result = omni_trajectory_plan(&plan, &config, &k, &points, &at);
    printf("%s: %d\n", what, (int)result);
    return kinematics == OMNI_OK && result == OMNI_ERR_RANGE;
}

/* Within the range of TRJ_LAPS, but no nanosecond long: the robot stays where it is. */
static int rests(void) {
    const omni_kinematics_config_t layout = {
        3, {0.05f, 0.05f, 0.05f}, {0.26f, 0.26f, 0.26f}, {0.0f, 2.0943951f, 4.1887902f}};
    const omni_pose_t origin = {0.0f, 0.0f, 0.0f};
    omni_trajectory_config_t config = possible;
    omni_kinematics_t k;
    omni_trajectory_t plan;
    omni_reference_t reference;
    config.type = OMNI_TRJ_TYPE_IDENTIFY;
    config.laps = 1e-30f;
    const omni_result_t kinematics = omni_kinematics_init(&k, &layout);
    const omni_result_t result = omni_trajectory_plan(&plan, &config, &k, NULL, &origin);
    for (uint64_t time_us = 0; time_us < 4000000; time_us += 1000) {
        omni_trajectory_evaluate(&plan, time_us, &reference);
    }
    printf("laps of no length: %d\n", (int)result);
    return kinematics == OMNI_OK && result == OMNI_OK;
}

int main(void) {
    const omni_pose_t origin = {0.0f, 0.0f, 0.0f};
    const int weak = is_refused("motors without voltage", 1e-9f, origin, (omni_pose_t){1.0f, 0.0f, 0.0f});
    const int far = is_refused("a start far away", 12.0f, origin, (omni_pose_t){1e30f, 0.0f, 0.0f});
    const int spun = is_refused("a robot that has turned too often", 12.0f, (omni_pose_t){0.0f, 0.0f, -1e12f}, origin);
    const int turned = is_refused("a waypoint turned too often", 12.0f, origin, (omni_pose_t){0.0f, 0.0f, 1e12f});
    return weak && far && spun && turned && rests() ? 0 : 1;
}
