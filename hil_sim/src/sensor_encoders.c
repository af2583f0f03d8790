/* SPDX-License-Identifier: MIT */
/* Sensor encoders: a counter per wheel. */
#include <stddef.h>

#include "hil_sim/random.h"
#include "sensor.h"

static int32_t count_direction(const hil_world_t *world, uint32_t wheel) {
    if (hil_fault_find(world, HIL_FAULT_ENCODER_STUCK, wheel) != NULL) {
        return 0;
    }
    const int32_t direction = world->config.encoder_direction[wheel];
    return hil_fault_find(world, HIL_FAULT_ENCODER_REVERSED, wheel) != NULL ? -direction : direction;
}

void hil_encoders_set_edges(hil_world_t *world, uint32_t wheel, hil_real_t edges) {
    const hil_real_t passed = (edges - world->encoder_edges[wheel]) * count_direction(world, wheel);
    world->encoder_edges[wheel] = edges;
    world->counts[wheel] = hil_count_on(world->counts[wheel], passed);
}

static void count_edges(hil_world_t *world) {
    const double edges_per_rad = world->config.counts_per_revolution / (2.0 * HIL_PI);
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        const hil_real_t angle_rad =
            world->plant.play ? world->wheel_angle_rad[i] + world->gap_rad[i] : world->wheel_angle_rad[i];
        hil_encoders_set_edges(world, i, hil_floor(angle_rad * edges_per_rad));
    }
}

static hil_int_t read_counter(const hil_world_t *world, uint32_t wheel) {
    hil_int_t count = world->counts[wheel];
    const hil_fault_t *noisy = hil_fault_find(world, HIL_FAULT_ENCODER_NOISY, wheel);
    if (noisy != NULL) {
        const hil_real_t u = hil_uniform(world->config.seed, HIL_STREAM_ENCODER + wheel, world->steps);
        count = hil_count_on(count, hil_floor((2.0 * u - 1.0) * noisy->value + 0.5));
    }
    const hil_fault_t *stuck = hil_fault_find(world, HIL_FAULT_ENCODER_BIT, wheel);
    if (stuck != NULL) {
        count = count | (int32_t)(UINT32_C(1) << (uint32_t)stuck->value);
    }
    return count;
}

void hil_world_counts(const hil_world_t *world, hil_int_t *counts) {
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        counts[i] = read_counter(world, i);
    }
}

static uint8_t valid_counts(const hil_world_t *world) {
    uint32_t valid = 0;
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        valid |= (uint32_t)(hil_fault_find(world, HIL_FAULT_ENCODER_INVALID, i) == NULL) << i;
    }
    return (uint8_t)valid;
}

static void show_counts(hil_world_t *world, hil_sensors_t *sensors) {
    hil_world_counts(world, sensors->counts);
    sensors->counts_valid = valid_counts(world);
}

const hil_sensor_t hil_sensor_encoders = {.integrate = count_edges, .show = show_counts};
