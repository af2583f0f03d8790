/* SPDX-License-Identifier: MIT */
#include "hil_sim/external.h"

#include <string.h>

#include "parts.h"

static void copy_motion(hil_world_t *electronics, const hil_external_state_t *outside) {
    memcpy(electronics->pose, outside->pose, sizeof electronics->pose);
    memcpy(electronics->twist, outside->twist, sizeof electronics->twist);
    memcpy(electronics->wheel_rad_s, outside->wheel_rad_s, sizeof electronics->wheel_rad_s);
    memcpy(electronics->current_A, outside->current_A, sizeof electronics->current_A);
    electronics->supply_V = outside->supply_V;
    for (uint32_t i = 0; i < electronics->config.wheels; i++) {
        hil_encoders_set_edges(electronics, i, outside->edges[i]);
    }
}

static void take_fixes(hil_world_t *electronics, const hil_external_state_t *outside) {
    hil_sensors_sample(electronics);
    if (outside->has_fix) {
        hil_pose_queue_fix(electronics, outside->fix_taken_us, outside->fix);
    }
}

void hil_external_start(hil_world_t *electronics, const hil_external_state_t *outside) {
    electronics->fixes_taken = 0; /* the sample of hil_world_init() saw its own start */
    electronics->fix_head = 0;
    electronics->fix_count = 0;
    copy_motion(electronics, outside);
    take_fixes(electronics, outside);
}

void hil_external_update(hil_world_t *electronics, const hil_external_state_t *outside, uint32_t step_us) {
    copy_motion(electronics, outside);
    electronics->time_us += step_us;
    electronics->steps++;
    hil_faults_update(electronics);
    take_fixes(electronics, outside);
}

void hil_external_get_drive(hil_world_t *electronics, double *duty, double *coast) {
    hil_chip_power_loss(electronics);
    for (uint32_t i = 0; i < electronics->config.wheels; i++) {
        const hil_drv8871_t *bridge = &electronics->bridge[i];
        const bool dead = hil_fault_find(electronics, HIL_FAULT_MOTOR_DEAD, i) != NULL;
        duty[i] = dead ? 0.0 : bridge->drive * electronics->config.motor_direction[i];
        coast[i] = dead ? 1.0 : bridge->coast;
    }
}
