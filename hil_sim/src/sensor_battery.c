/* SPDX-License-Identifier: MIT */
/* Sensor battery: the supply voltage under load. */
#include "sensor.h"

static void show_voltage(hil_world_t *world, hil_sensors_t *sensors) {
    sensors->battery_V = world->supply_V;
}

const hil_sensor_t hil_sensor_battery = {.show = show_voltage};
