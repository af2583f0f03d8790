/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "hil_sim/runner.h"

static omni_twist_t true_twist(const hil_world_t *world) {
    return (omni_twist_t){(omni_real_t)world->twist[0], (omni_real_t)world->twist[1], (omni_real_t)world->twist[2]};
}

static omni_pose_t true_pose(const hil_world_t *world) {
    return (omni_pose_t){(omni_real_t)world->pose[0], (omni_real_t)world->pose[1], (omni_real_t)world->pose[2]};
}

static void keep_larger(double *kept, double value) {
    *kept = fabs(value) > fabs(*kept) ? value : *kept;
}

/* The same torques for a tick, but what the protection takes away. */
static hil_result_t protected_tick(hil_world_t *world, const omni_kinematics_t *k,
                                   const omni_direct_torque_config_t *config, const omni_twist_t *floor_world,
                                   const omni_real_t *asked_N_m, double *given_N_m) {
    omni_real_t torque_N_m[OMNI_MAX_WHEELS], wheel_rad_s[OMNI_MAX_WHEELS];
    memcpy(torque_N_m, asked_N_m, sizeof torque_N_m);
    for (uint8_t i = 0; i < k->wheels; i++) {
        wheel_rad_s[i] = (omni_real_t)world->wheel_rad_s[i];
    }
    const omni_twist_t known = floor_world == NULL ? true_twist(world) : *floor_world;
    const omni_twist_t floor = omni_twist_to_body(&known, (omni_real_t)world->pose[2]);
    /* cppcheck-suppress uninitvar ; as many as there are wheels */
    (void)omni_direct_torque_protect(config, k, &floor, wheel_rad_s, torque_N_m);
    for (uint8_t i = 0; i < k->wheels; i++) {
        given_N_m[i] = (double)torque_N_m[i];
    }
    return hil_world_drive_torque(world, given_N_m);
}

static void record_slip(const hil_world_t *world, double *slip_m_s) {
    const double c = cos(world->pose[2]), s = sin(world->pose[2]);
    const double vx = c * world->twist[0] + s * world->twist[1];
    const double vy = c * world->twist[1] - s * world->twist[0];
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        const hil_plant_t *plant = &world->plant;
        const double floor_m_s = plant->along_x[i] * vx + plant->along_y[i] * vy + plant->arm_m[i] * world->twist[2];
        keep_larger(&slip_m_s[i], plant->radius_m[i] * world->wheel_rad_s[i] - floor_m_s);
    }
}

hil_result_t hil_run_direct_torque(hil_world_t *world, const omni_kinematics_t *k,
                                   const omni_direct_torque_config_t *config, const omni_reference_t *reference,
                                   const omni_twist_t *floor_world, uint32_t ticks, hil_torque_peaks_t *peaks) {
    const omni_pose_t pose = true_pose(world);
    const omni_twist_t rate = true_twist(world);
    omni_real_t asked_N_m[OMNI_MAX_WHEELS] = {0};
    omni_control_terms_t terms;
    memset(peaks, 0, sizeof *peaks);
    if (k->wheels != world->config.wheels) {
        return HIL_ERR_CONFIG;
    }
    (void)omni_direct_torque_step(config, k, &pose, &rate, reference, asked_N_m, &terms);
    for (uint32_t tick = 0; tick < ticks; tick++) {
        double given_N_m[HIL_MAX_WHEELS] = {0.0};
        const hil_result_t result = protected_tick(world, k, config, floor_world, asked_N_m, given_N_m);
        if (result != HIL_OK) {
            return result;
        }
        hil_world_step(world, OMNI_TICK_US);
        for (uint8_t i = 0; i < k->wheels; i++) {
            keep_larger(&peaks->torque_N_m[i], given_N_m[i]);
        }
        record_slip(world, peaks->slip_m_s);
    }
    return HIL_OK;
}
