/* SPDX-License-Identifier: MIT */
/* Which faults act, and what the robot's electronics make of some of them. */
#include <stddef.h>

#include "parts.h"

static bool covers(const hil_fault_t *fault, uint8_t kind, uint32_t wheel, double time_us) {
    const bool concerns = wheel >= HIL_MAX_WHEELS || fault->wheel == wheel;
    /* Half a microsecond, because times given in seconds are rounded. */
    const bool now = time_us >= fault->start_s * 1e6 - 0.5 && time_us < fault->stop_s * 1e6 - 0.5;
    return fault->kind == kind && concerns && now;
}

void hil_faults_update(hil_world_t *world) {
    world->active_faults = 0;
    for (uint32_t i = 0; i < world->config.fault_count; i++) {
        const hil_fault_t *fault = &world->config.fault[i];
        const bool active = covers(fault, fault->kind, fault->wheel, (double)world->time_us);
        world->active_faults |= (uint32_t)active << fault->kind;
    }
}

const hil_fault_t *hil_fault_search(const hil_world_t *world, uint8_t kind, uint32_t wheel) {
    for (uint32_t i = 0; i < world->config.fault_count; i++) {
        const hil_fault_t *fault = &world->config.fault[i];
        if (covers(fault, kind, wheel, (double)world->time_us)) {
            return fault;
        }
    }
    return NULL;
}

bool hil_world_fault_active(const hil_world_t *world, uint8_t kind, uint32_t wheel) {
    return hil_fault_find(world, kind, wheel) != NULL;
}

double hil_world_fault_value(const hil_world_t *world, uint8_t kind) {
    const hil_fault_t *fault = hil_fault_find(world, kind, HIL_MAX_WHEELS);
    return fault == NULL ? 0.0 : fault->value;
}

uint32_t hil_world_tick_us(const hil_world_t *world, uint32_t usual_us) {
    const hil_fault_t *late = hil_fault_find(world, HIL_FAULT_TICK_LATE, HIL_MAX_WHEELS);
    return late == NULL ? usual_us : (uint32_t)(1e6 * late->value + 0.5);
}

uint8_t hil_bus_fault(const hil_world_t *world) {
    if (hil_fault_find(world, HIL_FAULT_I2C_STUCK, HIL_MAX_WHEELS) != NULL) {
        return HIL_I2C_BUS_STUCK;
    }
    const bool silent = hil_fault_find(world, HIL_FAULT_I2C_NACK, HIL_MAX_WHEELS) != NULL ||
                        hil_fault_find(world, HIL_FAULT_CHIP_POWER, HIL_MAX_WHEELS) != NULL;
    return silent ? HIL_I2C_NOT_ACKNOWLEDGED : 0;
}

/* What the robot takes for the time; never before the clock's zero. */
uint64_t hil_robot_clock_us(const hil_world_t *world) {
    const hil_fault_t *stuck = hil_fault_find(world, HIL_FAULT_CLOCK_STUCK, HIL_MAX_WHEELS);
    if (stuck != NULL) {
        return (uint64_t)(stuck->start_s * 1e6);
    }
    const hil_fault_t *jump = hil_fault_find(world, HIL_FAULT_CLOCK_JUMP, HIL_MAX_WHEELS);
    if (jump == NULL) {
        return world->time_us;
    }
    const double time_us = (double)world->time_us + 1e6 * jump->value;
    return time_us > 0.0 ? (uint64_t)(time_us + 0.5) : 0;
}
