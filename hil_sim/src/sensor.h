/* SPDX-License-Identifier: MIT */
/**
 * @file sensor.h
 * A sensor of the world: hil_sensor_NAME in sensor_NAME.c for each row of [sensors] in shared/world.toml. What it keeps
 * from tick to tick is in hil_world_t, what it shows in hil_sensors_t. A sensor sees the truth of the world and its own
 * faults, nothing of the robot's filters.
 */
#ifndef HIL_SIM_SENSOR_H
#define HIL_SIM_SENSOR_H

#include "parts.h"

typedef struct hil_sensor_t {
    /** A step has moved the world; time and faults are still those at its start. For what adds up, like a counter. May
     * be NULL. */
    void (*integrate)(hil_world_t *world);
    /** Time and faults are those of now: after each step, and once at time zero. For what is taken at its own times.
     * May be NULL. */
    void (*sample)(hil_world_t *world);
    /** Write what it shows now. `sensors` was zero before. */
    void (*show)(hil_world_t *world, hil_sensors_t *sensors);
} hil_sensor_t;

#endif
