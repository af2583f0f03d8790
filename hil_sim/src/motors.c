/* SPDX-License-Identifier: MIT */
/* Bridges and windings: what the electrics apply during a step. */
#include <string.h>

#include "parts.h"

void hil_motors_apply_inputs(hil_world_t *world, uint32_t wheel, hil_real_t phase1, hil_real_t phase2,
                             double period_s) {
    hil_drv8871_inputs(&world->bridge[wheel], world->in1[wheel], phase1, world->in2[wheel], phase2, period_s);
}

static hil_winding_t winding_of(const hil_world_t *world, uint32_t wheel) {
    const hil_world_config_t *config = &world->config;
    return (hil_winding_t){config->motor_resistance_ohm, config->motor_inductance_H,
                           config->motor_constant_N_m_A * hil_motor_rad_s(world, wheel) *
                               config->motor_direction[wheel]};
}

/* Works in the bridge's direction and turns the results into the wheel's. */
static void open_winding(hil_world_t *world, uint32_t wheel, double step_s, hil_real_t *end_A) {
    const double direction = world->config.motor_direction[wheel];
    const hil_winding_t winding = winding_of(world, wheel);
    hil_real_t current_A = direction * world->current_A[wheel];
    world->current_A[wheel] = direction * hil_drv8871_freewheel(&winding, world->supply_V, step_s, &current_A);
    *end_A = direction * current_A;
}

static void drive_winding(const hil_world_t *world, uint32_t wheel, hil_electrics_t *electrics) {
    const hil_drv8871_t *bridge = &world->bridge[wheel];
    const double direction = world->config.motor_direction[wheel];
    electrics->closed[wheel] = 1.0;
    electrics->drive[wheel] = direction * bridge->drive;
    if (bridge->coast > 0.0) {
        const hil_winding_t winding = winding_of(world, wheel);
        electrics->offset_V[wheel] = direction * hil_drv8871_mean_V(bridge, &winding, world->supply_V);
    } else {
        electrics->gain[wheel] = direction * bridge->drive;
    }
}

/* A torque is a current that the winding can't change; speeds pass the motors by. */
static void ideal_source(hil_world_t *world, uint32_t wheel, hil_electrics_t *electrics, hil_real_t *end_A) {
    if (world->source == HIL_SOURCE_VOLTAGE) {
        electrics->closed[wheel] = 1.0;
        electrics->offset_V[wheel] = world->driven[wheel];
    } else if (world->source == HIL_SOURCE_TORQUE) {
        world->current_A[wheel] = world->driven[wheel] / world->config.motor_constant_N_m_A;
        *end_A = world->current_A[wheel];
    }
}

void hil_motors_begin(hil_world_t *world, hil_electrics_t *electrics, double step_s, hil_real_t *open_end_A) {
    memset(electrics, 0, sizeof *electrics);
    electrics->battery_V = hil_fault_value(world, HIL_FAULT_BATTERY_SAG, world->config.battery_V);
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        if (hil_fault_find(world, HIL_FAULT_MOTOR_DEAD, i) != NULL) {
            world->current_A[i] = 0.0;
            open_end_A[i] = 0.0;
        } else if (world->source != HIL_SOURCE_BRIDGES) {
            ideal_source(world, i, electrics, &open_end_A[i]);
        } else if (hil_drv8871_open(&world->bridge[i])) {
            open_winding(world, i, step_s, &open_end_A[i]);
        } else {
            drive_winding(world, i, electrics);
        }
    }
}

void hil_motors_end(hil_world_t *world, const hil_electrics_t *electrics, const hil_real_t *open_end_A) {
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        world->current_A[i] = hil_select(electrics->closed[i] > 0.0, world->current_A[i], open_end_A[i]);
        world->voltage_V[i] = electrics->gain[i] * world->supply_V + electrics->offset_V[i];
    }
}
