/* SPDX-License-Identifier: MIT */
/* What the plants share: the table of them, the step in substeps, and the way from body velocity to pose. */

#include "motion.h"
#include "plants_gen.h"

/* The reference tests allow 1e-3 after a second of full-scale steps of the voltages: 0.33 ms is 4e-3 off where wheels
 * break away. */
static const double SUBSTEP_MAX_s = 0.25e-3;

const hil_plant_model_t *hil_plant_model(uint32_t plant) {
    return HIL_PLANTS[plant];
}

void hil_plant_set_source(hil_world_t *world, uint32_t source) {
    const hil_plant_model_t *model = hil_plant_model(world->config.plant);
    world->source = source;
    if (model->source != NULL) {
        model->source(world, source);
    }
}

hil_real_t hil_floor_speed(const hil_plant_t *plant, const hil_real_t *v, uint32_t wheel) {
    return plant->along_x[wheel] * v[0] + plant->along_y[wheel] * v[1] + plant->arm_m[wheel] * v[2];
}

/* Cosine and sine of the small angle of half a substep. */
static void small_cos_sin(hil_real_t angle_rad, hil_real_t *cos_sin) {
    const hil_real_t x2 = angle_rad * angle_rad;
    cos_sin[0] = 1.0 - x2 * (1.0 / 2.0) * (1.0 - x2 * (1.0 / 12.0));
    cos_sin[1] = angle_rad * (1.0 - x2 * (1.0 / 6.0) * (1.0 - x2 * (1.0 / 20.0)));
}

static void turn(hil_real_t *cos_sin, const hil_real_t *by) {
    const hil_real_t cos_before = cos_sin[0];
    cos_sin[0] = cos_before * by[0] - cos_sin[1] * by[1];
    cos_sin[1] = cos_sin[1] * by[0] + cos_before * by[1];
}

/* Positions by the midpoint rule; leaves cos_sin at the heading of the substep's end. */
static void advance(hil_world_t *world, const hil_motion_t *before, const hil_motion_t *after, double step_s,
                    hil_real_t *cos_sin) {
    const double half = 0.5 * step_s;
    const hil_real_t turned_rad = half * (before->v[2] + after->v[2]);
    const hil_real_t dx = half * (before->v[0] + after->v[0]);
    const hil_real_t dy = half * (before->v[1] + after->v[1]);
    hil_real_t half_turn[2];
    small_cos_sin(0.5 * turned_rad, half_turn);
    turn(cos_sin, half_turn);
    world->pose[0] += cos_sin[0] * dx - cos_sin[1] * dy;
    world->pose[1] += cos_sin[1] * dx + cos_sin[0] * dy;
    world->pose[2] += turned_rad;
    turn(cos_sin, half_turn);
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        world->wheel_angle_rad[i] += half * (before->w[i] + after->w[i]);
    }
}

void hil_motion_load(const hil_world_t *world, hil_motion_t *y, const hil_real_t *cos_sin) {
    y->v[0] = cos_sin[0] * world->twist[0] + cos_sin[1] * world->twist[1];
    y->v[1] = cos_sin[0] * world->twist[1] - cos_sin[1] * world->twist[0];
    y->v[2] = world->twist[2];
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        y->w[i] = world->wheel_rad_s[i];
        y->i[i] = world->current_A[i];
    }
}

void hil_motion_store(hil_world_t *world, const hil_motion_t *y, const hil_real_t *cos_sin) {
    world->twist[0] = cos_sin[0] * y->v[0] - cos_sin[1] * y->v[1];
    world->twist[1] = cos_sin[1] * y->v[0] + cos_sin[0] * y->v[1];
    world->twist[2] = y->v[2];
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        world->wheel_rad_s[i] = y->w[i];
        world->current_A[i] = y->i[i];
    }
}

/* With electrics of its own. */
static void limited_substep(hil_world_t *world, const hil_electrics_t *electrics, hil_motion_t *y, double step_s,
                            hil_substep_t *substep) {
    hil_limited_electrics_t now;
    hil_contact_t contact;
    hil_limits_before_substep(world, electrics, y, step_s, &now);
    hil_contact_begin(&contact, world, &now.electrics, step_s);
    substep(world, &now.electrics, &contact, y, step_s);
    hil_limits_after_substep(world, electrics, &now, y, step_s);
}

void hil_integrate_substeps(hil_world_t *world, const hil_electrics_t *electrics, double step_s,
                            void (*fit)(const hil_world_t *world, hil_motion_t *y), hil_substep_t *substep) {
    const int substeps = 1 + (int)((step_s - 1e-9) / SUBSTEP_MAX_s);
    const double substep_s = step_s / substeps;
    hil_real_t cos_sin[2];
    hil_motion_t y;
    hil_contact_t contact;
    hil_cos_sin(world->pose[2], cos_sin);
    hil_motion_load(world, &y, cos_sin);
    if (fit != NULL) {
        fit(world, &y);
    }
    hil_contact_begin(&contact, world, electrics, substep_s);
    for (int n = 0; n < substeps; n++) {
        const hil_motion_t before = y;
        if (world->plant.limits) {
            limited_substep(world, electrics, &y, substep_s, substep);
        } else {
            substep(world, electrics, &contact, &y, substep_s);
        }
        advance(world, &before, &y, substep_s, cos_sin);
    }
    hil_motion_store(world, &y, cos_sin);
}

void hil_plant_step(hil_world_t *world, const hil_electrics_t *electrics, double step_s) {
    hil_plant_model(world->config.plant)->step(world, electrics, step_s);
}
