/* SPDX-License-Identifier: MIT */
/* Sensor stop_button: a contact that somebody opens, or whose wire is cut. */
#include <stddef.h>

#include "sensor.h"

static void show_contact(hil_world_t *world, hil_sensors_t *sensors) {
    sensors->stop_button = hil_fault_find(world, HIL_FAULT_STOP_BUTTON, HIL_MAX_WHEELS) != NULL;
}

const hil_sensor_t hil_sensor_stop_button = {.show = show_contact};
