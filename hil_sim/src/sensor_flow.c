/* SPDX-License-Identifier: MIT */
/*
 * Sensor flow: how far a point of the body moves over the floor, along axes that turn with the body. It also says how
 * far the body turns.
 *
 *   sum     = integral of the point's velocity in the sensor's axes, and of the turn rate
 *   reading = (1 + scale error) (sum now - sum then) + noise, from counters that have steps
 *
 * Readings are due at k / rate, are taken in the first tick that is not before, and arrive later. What a reading that
 * is not valid measured is lost. A sensor that is silent goes on counting.
 */
#include <string.h>

#include "hil_sim/random.h"
#include "sensor.h"

enum { FLOW_AXES = 3, FLOW_READ = 8 };

/* Over a tick the heading of mid-way is as good as the integral: to 1e-9 of it. */
void hil_world_flow_way(const hil_world_t *world, hil_real_t *pose, hil_real_t *way) {
    const hil_world_config_t *config = &world->config;
    hil_real_t moved[FLOW_AXES];
    for (uint32_t axis = 0; axis < FLOW_AXES; axis++) {
        moved[axis] = world->pose[axis] - pose[axis];
        pose[axis] = world->pose[axis];
    }
    hil_real_t heading[2];
    hil_real_t mount[2];
    hil_cos_sin(world->pose[2] - 0.5 * moved[2], heading);
    hil_cos_sin(config->flow_angle_rad, mount);
    const hil_real_t x = heading[0] * moved[0] + heading[1] * moved[1] - config->flow_y_m * moved[2];
    const hil_real_t y = heading[0] * moved[1] - heading[1] * moved[0] + config->flow_x_m * moved[2];
    way[0] = mount[0] * x + mount[1] * y;
    way[1] = mount[0] * y - mount[1] * x;
    way[2] = moved[2];
}

/* Add the way since the last call. */
static void add_flow(hil_world_t *world) {
    hil_real_t way[FLOW_AXES];
    hil_world_flow_way(world, world->flow_pose, way);
    for (uint32_t axis = 0; axis < FLOW_AXES; axis++) {
        world->flow_sum[axis] += way[axis];
    }
}

static hil_real_t in_steps(hil_real_t value, double step) {
    return step > 0.0 ? hil_nearest(value / step) * step : value;
}

/* Its counters have moved by this. They keep what the rounding leaves for the next reading; noise is in them, too. */
static void read_flow(hil_world_t *world, hil_flow_t *flow) {
    const hil_world_config_t *config = &world->config;
    const hil_real_t gain = 1.0 + config->flow_scale_error;
    const hil_real_t drift = config->flow_turn_bias_rad_s * hil_normal(config->seed, HIL_STREAM_FLOW_BIAS, 0);
    const hil_real_t way2 = world->flow_sum[0] * world->flow_sum[0] + world->flow_sum[1] * world->flow_sum[1];
    const hil_real_t sd =
        hil_sqrt(config->flow_sd_m * config->flow_sd_m + config->flow_share * config->flow_share * way2);
    const double step[FLOW_AXES] = {config->flow_step_m, config->flow_step_m, config->flow_turn_step_rad};
    for (uint32_t axis = 0; axis < FLOW_AXES; axis++) {
        const hil_real_t noise = hil_normal(config->seed, HIL_STREAM_FLOW + axis, world->flow_samples);
        const hil_real_t turned =
            world->flow_sum[2] + drift / (hil_real_t)config->flow_rate_Hz + config->flow_turn_sd_rad * noise;
        const hil_real_t moved = axis < 2 ? gain * world->flow_sum[axis] + sd * noise : turned;
        const hil_real_t counter = world->flow_read[axis] + moved; /* exact: what is left of the step before is in it */
        flow->moved[axis] = in_steps(counter, step[axis]);
        world->flow_read[axis] = counter - flow->moved[axis];
        world->flow_sum[axis] = 0.0;
    }
}

static void queue_flow(hil_world_t *world, const hil_flow_t *flow) {
    if (world->flow_count == HIL_MAX_FLOWS) { /* nobody asked for the oldest: it is lost */
        world->flow_head = (world->flow_head + 1) % HIL_MAX_FLOWS;
        world->flow_count--;
    }
    world->flow[(world->flow_head + world->flow_count) % HIL_MAX_FLOWS] = *flow;
    world->flow_count++;
}

static void take_flow(hil_world_t *world, uint64_t due_us) {
    const hil_world_config_t *config = &world->config;
    hil_flow_t flow;
    memset(&flow, 0, sizeof flow);
    flow.arrives_us = due_us + (uint64_t)(config->flow_delay_s * 1e6 + 0.5);
    flow.dropped = (hil_flag_t)(hil_uniform(config->seed, HIL_STREAM_FLOW_DROP, world->flow_samples) <
                                config->flow_drop_probability);
    read_flow(world, &flow);
    flow.moved[0] += hil_fault_value(world, HIL_FAULT_FLOW_JUMP, 0.0);
    if (hil_fault_find(world, HIL_FAULT_FLOW_STUCK, HIL_MAX_WHEELS) != NULL) {
        memset(flow.moved, 0, sizeof flow.moved);
    }
    queue_flow(world, &flow);
}

static void sample_flow(hil_world_t *world) {
    const hil_world_config_t *config = &world->config;
    if (config->flow_rate_Hz <= 0.0) {
        return;
    }
    if (world->flow_samples == 0) {
        memcpy(world->flow_pose, world->pose, sizeof world->flow_pose);
    }
    add_flow(world);
    const uint64_t due_us = (uint64_t)((double)world->flow_samples * 1e6 / config->flow_rate_Hz + 0.5);
    if (due_us <= world->time_us) {
        if (hil_fault_find(world, HIL_FAULT_FLOW_SILENT, HIL_MAX_WHEELS) == NULL) {
            take_flow(world, world->time_us);
        }
        world->flow_samples++;
    }
}

static void show_flow(hil_world_t *world, hil_sensors_t *sensors) {
    const hil_flow_t *flow = &world->flow[world->flow_head];
    if (world->flow_count == 0 || flow->arrives_us > world->time_us) {
        return;
    }
    for (uint32_t axis = 0; axis < FLOW_AXES; axis++) {
        sensors->flow_moved[axis] = flow->moved[axis];
    }
    sensors->flow_valid = FLOW_READ;
    if (!flow->dropped) {
        sensors->flow_valid = (uint8_t)(FLOW_READ | 3u | (world->config.flow_turns ? 4u : 0u));
    }
    world->flow_head = (world->flow_head + 1) % HIL_MAX_FLOWS;
    world->flow_count--;
}

const hil_sensor_t hil_sensor_flow = {.sample = sample_flow, .show = show_flow};
