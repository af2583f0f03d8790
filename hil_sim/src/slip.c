/* SPDX-License-Identifier: MIT */
/* Imposed slip: a random ratio per wheel, drawn at evenly spaced knots and linear between. */
#include "hil_sim/random.h"
#include "parts.h"

static double knot_value(const hil_world_t *world, uint32_t wheel, uint64_t knot) {
    return world->config.slip_max * hil_uniform(world->config.seed, HIL_STREAM_SLIP + wheel, knot);
}

static void draw_knots(hil_world_t *world, uint64_t knot) {
    world->slip_knot = knot;
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        world->slip_before[i] = knot_value(world, i, knot);
        world->slip_after[i] = knot_value(world, i, knot + 1);
    }
}

void hil_slip_init(hil_world_t *world) {
    draw_knots(world, 0);
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
