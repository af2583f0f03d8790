/* SPDX-License-Identifier: MIT */
/* What the plants share: constants, the step in substeps, and the way from body velocity to pose. */
#include <math.h>
#include <string.h>

#include "motion.h"
#include "spd3.h"

static const double GRAVITY_m_s2 = 9.80665;
static const double SUBSTEP_MAX_s = 0.25e-3;

enum { N = HIL_MAX_WHEELS };

static void wheels_init(hil_plant_t *plant, const hil_world_config_t *config) {
    double rolling[6] = {0.0};
    for (uint32_t i = 0; i < config->wheels; i++) {
        const double cos_a = cos(config->wheel_angle_rad[i]);
        const double sin_a = sin(config->wheel_angle_rad[i]);
        plant->radius_m[i] = config->wheel_radius_m[i];
        plant->along_x[i] = -sin_a;
        plant->along_y[i] = cos_a;
        plant->arm_m[i] = config->wheel_distance_m[i]; /* (cos, sin) x (-sin, cos) = 1 */
        plant->drag_xx += config->roller_friction_N_s_m * cos_a * cos_a;
        plant->drag_xy += config->roller_friction_N_s_m * cos_a * sin_a;
        plant->drag_yy += config->roller_friction_N_s_m * sin_a * sin_a;
        hil_spd3_add(rolling, 1.0, plant->along_x[i], plant->along_y[i], plant->arm_m[i]);
    }
    hil_spd3_factor(&plant->rolling, rolling);
}

/* The report's models leave out what `full` adds. */
static void leave_out(hil_plant_t *plant, uint32_t kind) {
    if (kind == HIL_PLANT_FULL) {
        return;
    }
    plant->battery_resistance_ohm = 0.0;
    plant->drag_xx = plant->drag_xy = plant->drag_yy = 0.0;
    plant->coulomb_N_m = kind == HIL_PLANT_SLIP ? 0.0 : plant->coulomb_N_m;
    plant->stiffness_N_s_m = kind == HIL_PLANT_SLIP ? plant->stiffness_N_s_m : 0.0;
}

void hil_plant_init(hil_plant_t *plant, const hil_world_config_t *config) {
    *plant = (hil_plant_t){0};
    wheels_init(plant, config);
    const double load_N = config->mass_kg * GRAVITY_m_s2 / config->wheels;
    plant->stiffness_N_s_m = config->slip_stiffness_N_s_m;
    plant->inverse_limit_N = 1.0 / (config->friction_coefficient * load_N);
    plant->inverse_mass = 1.0 / config->mass_kg;
    plant->inverse_inertia = 1.0 / config->inertia_kg_m2;
    plant->inverse_motor_inertia = 1.0 / config->motor_inertia_kg_m2;
    plant->inverse_inductance = 1.0 / config->motor_inductance_H;
    plant->viscous_N_m_s = config->motor_viscous_N_m_s;
    plant->coulomb_N_m = config->motor_coulomb_N_m;
    plant->battery_resistance_ohm = config->battery_resistance_ohm;
    hil_linear_init(plant, config);
    leave_out(plant, config->plant);
}

bool hil_plant_takes(uint32_t plant, uint32_t source) {
    const bool kinematic = plant == HIL_PLANT_KINEMATIC;
    switch (source) {
    case HIL_SOURCE_SPEED:
        return kinematic;
    case HIL_SOURCE_TORQUE:
        return !kinematic && plant != HIL_PLANT_KINEMATIC_MOTORS;
    default:
        return true;
    }
}

void hil_plant_source(hil_world_t *world, uint32_t source) {
    world->source = source;
    if (world->config.plant == HIL_PLANT_SLIP) { /* (7) has no bearing friction, (24) has */
        world->plant.viscous_N_m_s = source == HIL_SOURCE_TORQUE ? 0.0 : world->config.motor_viscous_N_m_s;
    }
}

double hil_floor_speed(const hil_plant_t *plant, const double *v, uint32_t wheel) {
    return plant->along_x[wheel] * v[0] + plant->along_y[wheel] * v[1] + plant->arm_m[wheel] * v[2];
}

/* Turn a heading's (cos, sin) by the small angle of half a substep. */
static void turn(double *cos_sin, double angle_rad) {
    const double x2 = angle_rad * angle_rad;
    const double s = angle_rad * (1.0 - x2 / 6.0 * (1.0 - x2 / 20.0));
    const double c = 1.0 - x2 / 2.0 * (1.0 - x2 / 12.0);
    const double cos_before = cos_sin[0];
    cos_sin[0] = cos_before * c - cos_sin[1] * s;
    cos_sin[1] = cos_sin[1] * c + cos_before * s;
}

/* Positions by the midpoint rule; leaves cos_sin at the heading of the substep's end. */
static void advance(hil_world_t *world, const hil_motion_t *before, const hil_motion_t *after, double step_s, double *cos_sin) {
    const double half = 0.5 * step_s;
    const double turned_rad = half * (before->v[2] + after->v[2]);
    const double dx = half * (before->v[0] + after->v[0]);
    const double dy = half * (before->v[1] + after->v[1]);
    turn(cos_sin, 0.5 * turned_rad);
    world->pose[0] += cos_sin[0] * dx - cos_sin[1] * dy;
    world->pose[1] += cos_sin[1] * dx + cos_sin[0] * dy;
    world->pose[2] += turned_rad;
    turn(cos_sin, 0.5 * turned_rad);
    for (int i = 0; i < N; i++) {
        world->wheel_angle_rad[i] += half * (before->w[i] + after->w[i]);
    }
}

void hil_motion_load(const hil_world_t *world, hil_motion_t *y, const double *cos_sin) {
    y->v[0] = cos_sin[0] * world->twist[0] + cos_sin[1] * world->twist[1];
    y->v[1] = cos_sin[0] * world->twist[1] - cos_sin[1] * world->twist[0];
    y->v[2] = world->twist[2];
    for (int i = 0; i < N; i++) {
        y->w[i] = world->wheel_rad_s[i];
        y->i[i] = world->current_A[i];
    }
}

void hil_motion_store(hil_world_t *world, const hil_motion_t *y, const double *cos_sin) {
    world->twist[0] = cos_sin[0] * y->v[0] - cos_sin[1] * y->v[1];
    world->twist[1] = cos_sin[1] * y->v[0] + cos_sin[0] * y->v[1];
    world->twist[2] = y->v[2];
    memcpy(world->wheel_rad_s, y->w, sizeof world->wheel_rad_s);
    memcpy(world->current_A, y->i, sizeof world->current_A);
}

/* Imposed slip may have changed since the last step: wheels and body of the plants without a contact fit together at once. */
static void fit_together(const hil_world_t *world, hil_motion_t *y) {
    if (world->config.plant == HIL_PLANT_KINEMATIC_MOTORS) {
        hil_rolling_twist(world, y->w, y->v);
    } else if (world->config.plant == HIL_PLANT_LINEAR) {
        hil_linear_wheels(world, y->v, y->w);
    }
}

static void substep(hil_world_t *world, const hil_electrics_t *electrics, hil_motion_t *y, double step_s) {
    if (world->config.plant == HIL_PLANT_LINEAR) {
        hil_linear_substep(world, electrics, y, step_s);
        return;
    }
    hil_contact_substep(world, electrics, y, step_s);
    if (world->config.plant == HIL_PLANT_KINEMATIC_MOTORS) {
        hil_rolling_twist(world, y->w, y->v);
    }
}

void hil_plant_step(hil_world_t *world, const hil_electrics_t *electrics, double step_s) {
    if (world->config.plant == HIL_PLANT_KINEMATIC) {
        hil_kinematic_step(world, electrics, step_s);
        return;
    }
    const int substeps = 1 + (int)((step_s - 1e-9) / SUBSTEP_MAX_s);
    const double substep_s = step_s / substeps;
    double cos_sin[2] = {cos(world->pose[2]), sin(world->pose[2])};
    hil_motion_t y;
    hil_motion_load(world, &y, cos_sin);
    fit_together(world, &y);
    for (int n = 0; n < substeps; n++) {
        const hil_motion_t before = y;
        substep(world, electrics, &y, substep_s);
        advance(world, &before, &y, substep_s, cos_sin);
    }
    hil_motion_store(world, &y, cos_sin);
}
