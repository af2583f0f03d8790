/* SPDX-License-Identifier: MIT */
/* Any numbers as parameters, NaN and infinities too: a set is refused, or makes a configuration that the tick can rely
 * on. */
#include "any.h"

void proof_config(void) {
    omni_robot_config_t config;
    omni_real_t values[OMNI_PARAM_COUNT];
    int32_t bad;
    omni_uint_t type;
    ANYTHING(type);
    (void)omni_trajectory_needs_waypoints(type);
    ANYTHING(values);
    const omni_result_t result = omni_robot_config(&config, values, &bad);
    /*@ check bad_index: -1 <= bad < OMNI_PARAM_COUNT; */
    if (result != OMNI_OK) {
        return;
    }
    /*@ check wheels: 3 <= config.kinematics.wheels <= OMNI_MAX_WHEELS; */
    /*@ check same_wheels: 3 <= config.wheel_speed.wheels <= OMNI_MAX_WHEELS; */
    /*@ check period: 1 <= config.control_period <= 100; */
    /*@ check modes: config.controller < OMNI_CTL_MODE_COUNT && config.pose_ekf.mode <= OMNI_EKF_MODE_SLIP; */
    /*@ check duty_limit: 0.0 <= config.wheel_speed.duty_limit <= 1.0; */
    /*@ check supply: 3.0 <= config.limits.supply_nominal_V <= 60.0; */
    /*@ check resolution: 0.0 < config.rad_per_count <= 1.6; */
}
