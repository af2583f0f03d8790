/* SPDX-License-Identifier: MIT */
/** @file core_law.c  Ours: the control core's copy of the original law in float, called in every tick as the robot
 * does. */
#include <string.h>

#include "law.h"
#include "omni/original_law.h"

void core_law(const law_input_t *inputs, uint32_t periods, float *voltage_V) {
    static omni_original_state_t state;
    const omni_original_config_t config = omni_original_defaults(1e-3f, (omni_real_t)LAW_RAD_PER_COUNT);
    omni_kinematics_config_t geometry = {.wheels = LAW_WHEELS};
    for (int i = 0; i < LAW_WHEELS; i++) {
        geometry.radius_m[i] = (omni_real_t)LAW_RADIUS_M;
        geometry.distance_m[i] = (omni_real_t)LAW_DISTANCE_M;
        geometry.angle_rad[i] = 2.0943951f * (omni_real_t)i;
    }
    omni_kinematics_t k;
    (void)omni_kinematics_init(&k, &geometry);
    omni_original_reset(&state);
    for (uint32_t n = 0; n < periods; n++) {
        const law_input_t *input = &inputs[n];
        const omni_pose_t pose = {input->pose[0], input->pose[1], input->pose[2]};
        const omni_pose_t reference = {input->reference[0], input->reference[1], input->reference[2]};
        const omni_twist_t rate = {input->rate[0], input->rate[1], input->rate[2]};
        const int32_t still[OMNI_MAX_WHEELS] = {0};
        for (int tick = 0; tick < LAW_TICKS; tick++) {
            const int32_t *moved = tick == 0 ? input->moved_counts : still;
            omni_original_step(&state, &config, &k, moved, &pose, &reference, &rate, (omni_real_t)LAW_SUPPLY_V);
        }
        memcpy(&voltage_V[n * LAW_WHEELS], state.voltage_V, LAW_WHEELS * sizeof *voltage_V);
    }
}
