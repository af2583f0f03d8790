/* SPDX-License-Identifier: MIT */
/* All sensors of the world, one after another. */
#include <string.h>

#include "sensors_gen.h"

void hil_sensors_integrate(hil_world_t *world) {
    for (int i = 0; i < HIL_SENSOR_COUNT; i++) {
        if (HIL_SENSORS[i]->integrate != NULL) {
            HIL_SENSORS[i]->integrate(world);
        }
    }
}

void hil_sensors_sample(hil_world_t *world) {
    for (int i = 0; i < HIL_SENSOR_COUNT; i++) {
        if (HIL_SENSORS[i]->sample != NULL) {
            HIL_SENSORS[i]->sample(world);
        }
    }
}

void hil_world_sense(hil_world_t *world, hil_sensors_t *sensors) {
    memset(sensors, 0, sizeof *sensors);
    sensors->time_us = hil_robot_clock_us(world);
    sensors->i2c_status = world->i2c_status;
    sensors->i2c_read_length = world->i2c_read_length;
    memcpy(sensors->i2c_read, world->i2c_read, sizeof sensors->i2c_read);
    sensors->link_silent = hil_fault_find(world, HIL_FAULT_LINK_SILENCE, HIL_MAX_WHEELS) != NULL;
    for (int i = 0; i < HIL_SENSOR_COUNT; i++) {
        HIL_SENSORS[i]->show(world, sensors);
    }
}
