/* SPDX-License-Identifier: MIT */
/* Imposed slip: per wheel a random ratio, drawn at evenly spaced knots and linear between, and a random speed, held
 * from draw to draw. */
#include "hil_sim/random.h"
#include "parts.h"

static hil_real_t knot_value(const hil_world_t *world, uint32_t wheel, uint64_t knot) {
    return world->config.slip_max * hil_uniform(world->config.seed, HIL_STREAM_SLIP + wheel, knot);
}

static void draw_knots(hil_world_t *world, uint64_t knot) {
    world->slip_knot = knot;
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        world->slip_before[i] = knot_value(world, i, knot);
        world->slip_after[i] = knot_value(world, i, knot + 1);
    }
}

static void draw_speeds(hil_world_t *world, uint64_t knot) {
    const hil_world_config_t *config = &world->config;
    world->slip_speed_knot = knot;
    for (uint32_t i = 0; i < config->wheels; i++) {
        const hil_real_t share = 2.0 * hil_uniform(config->seed, HIL_STREAM_SLIP_SPEED + i, knot) - 1.0;
        world->slip_speed_m_s[i] = config->slip_speed_max_m_s * share;
    }
}

void hil_slip_init(hil_world_t *world) {
    draw_knots(world, 0);
    draw_speeds(world, 0);
    hil_slip_update(world, 0.0);
}

void hil_slip_update(hil_world_t *world, double time_s) {
    if (world->config.slip_max <= 0.0) {
        return;
    }
    const double position = time_s / world->config.slip_time_s;
    const uint64_t knot = (uint64_t)position;
    if (knot != world->slip_knot) {
        draw_knots(world, knot);
    }
    const double share = position - (double)knot;
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        world->slip_ratio[i] = world->slip_before[i] + share * (world->slip_after[i] - world->slip_before[i]);
    }
}

void hil_slip_draw_speeds(hil_world_t *world) {
    /* A millionth of an interval, because times given in seconds are rounded. */
    const uint64_t knot = (uint64_t)(1e-6 * (double)world->time_us / world->config.slip_time_s + 1e-6);
    if (knot != world->slip_speed_knot && world->config.slip_speed_max_m_s > 0.0) {
        draw_speeds(world, knot);
    }
}
