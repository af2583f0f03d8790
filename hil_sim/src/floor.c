/* SPDX-License-Identifier: MIT */
/* Real wheels on a real floor: rollers in rows, loads that move from wheel to wheel, dry drag, a slope.
 *
 * Patches of the floor have another friction: a wheel takes that of the patch under its contact point.
 *
 * A wheel rolls on one roller after another; with two rows, they take turns. The contact point then jumps along the
 * axle, and with it the lever arm about the body's middle. Near a hand-over the wheel stands lower: parabolas, deepest
 * between two rollers.
 *
 * The body stands on a spring and a damper per wheel and can rise, roll and pitch. That is where loads come from:
 *
 *     m z" = sum N - m g cos(slope),  I a" = sum y N + h Fy,  I b" = -sum x N - h Fx,  N = max(0, k c + d c'),
 *
 * c: how far the wheel is pressed in; h: height of the centre of mass; F: the wheels' tractions. It is integrated in
 * four pieces per tick (symplectic Euler), with the tractions of the tick before. Loads act on the next tick's grip. */
#include "hil_sim/random.h"
#include "motion.h"

enum { PIECES = 4 };
static const double DRY_WIDTH_m_s = 0.002; /* below this speed, dry drag fades */
static const double LEAST_SHARE = 1e-3;    /* of the load at rest: a wheel in the air keeps a finite limit */

void hil_floor_init(hil_plant_t *plant, const hil_world_config_t *config) {
    const bool rollers = config->rollers_per_row > 0, springs = config->wheel_stiffness_N_m > 0.0;
    plant->uneven = rollers || springs || config->roller_bushing_friction > 0.0 || config->floor_slope_rad > 0.0 ||
                    config->patch_count > 0;
    plant->weight_N = config->mass_kg * HIL_GRAVITY_m_s2 * cos(config->floor_slope_rad);
    plant->downhill_N = config->mass_kg * HIL_GRAVITY_m_s2 * sin(config->floor_slope_rad);
    const hil_real_t h = config->centre_of_mass_height_m;
    /* A cylinder as high as its centre of mass says, and as heavy and wide as its inertia about z says. */
    plant->inverse_tilt_inertia = 1.0 / (0.5 * config->inertia_kg_m2 + config->mass_kg * h * h * (1.0 / 3.0));
    for (uint32_t i = 0; i < config->wheels && rollers; i++) {
        const double rollers_on_wheel = config->wheel_rows * config->rollers_per_row;
        plant->roller_phase[i] = rollers_on_wheel * hil_uniform(config->seed, HIL_STREAM_ROLLERS + i, 0);
    }
}

/* Lever arm and radius by the roller that carries wheel i. @return how fast the axle sinks by that [m/s] */
static hil_real_t hil_floor_roller(hil_world_t *world, uint32_t i, hil_real_t *dip_m) {
    const hil_world_config_t *config = &world->config;
    const double rows = config->wheel_rows;
    const double per_rad = rows * config->rollers_per_row / (2.0 * HIL_PI);
    const hil_real_t position = world->wheel_angle_rad[i] * per_rad + world->plant.roller_phase[i];
    const hil_real_t roller = hil_floor(position);
    const hil_real_t row = roller - rows * hil_floor(roller * (1.0 / rows));
    const hil_real_t edge = 2.0 * (position - roller) - 1.0; /* -1..1 along the roller */
    *dip_m = config->roller_dip_m * edge * edge;
    world->plant.arm_m[i] = config->wheel_distance_m[i] + (row - 0.5 * (rows - 1.0)) * config->row_distance_m;
    world->plant.radius_m[i] = config->wheel_radius_m[i] - *dip_m;
    return 4.0 * config->roller_dip_m * edge * per_rad * world->wheel_rad_s[i];
}

/* Forces of the floor on the wheels along it, in the body frame. */
static void hil_floor_tractions(const hil_world_t *world, hil_real_t *sum_N) {
    sum_N[0] = sum_N[1] = 0.0;
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        sum_N[0] += world->plant.along_x[i] * world->traction_N[i];
        sum_N[1] += world->plant.along_y[i] * world->traction_N[i];
    }
}

/* One piece of the body's rise. Loads are added to world->load_N. */
static void hil_floor_rise(hil_world_t *world, const hil_real_t *dip_m, const hil_real_t *sinking_m_s,
                           const hil_real_t *traction_N, double piece_s) {
    const hil_world_config_t *config = &world->config;
    const hil_plant_t *plant = &world->plant;
    const hil_real_t pressed_m = plant->weight_N * (1.0 / (config->wheels * config->wheel_stiffness_N_m));
    hil_real_t up = -plant->weight_N;
    hil_real_t about_x = config->centre_of_mass_height_m * traction_N[1];
    hil_real_t about_y = -config->centre_of_mass_height_m * traction_N[0];
    for (uint32_t i = 0; i < config->wheels; i++) {
        const hil_real_t x = plant->along_y[i] * plant->arm_m[i], y = -plant->along_x[i] * plant->arm_m[i];
        const hil_real_t lifted_m = world->rise[0] + y * world->rise[1] - x * world->rise[2];
        const hil_real_t lifting_m_s = world->rise_rate[0] + y * world->rise_rate[1] - x * world->rise_rate[2];
        const hil_real_t spring_N = config->wheel_stiffness_N_m * (pressed_m - lifted_m - dip_m[i]);
        const hil_real_t damper_N = config->wheel_damping_N_s_m * (lifting_m_s + sinking_m_s[i]);
        const hil_real_t load_N = hil_select(spring_N > 0.0, hil_max(spring_N - damper_N, 0.0), 0.0 * spring_N);
        world->load_N[i] += load_N * (1.0 / PIECES);
        up += load_N;
        about_x += y * load_N;
        about_y -= x * load_N;
    }
    world->rise_rate[0] += piece_s * up * plant->inverse_mass;
    world->rise_rate[1] += piece_s * about_x * plant->inverse_tilt_inertia;
    world->rise_rate[2] += piece_s * about_y * plant->inverse_tilt_inertia;
    for (uint32_t n = 0; n < 3; n++) {
        world->rise[n] += piece_s * world->rise_rate[n];
    }
}

/* A point of the floor has the factor of the last patch that it lies in. */
static hil_real_t hil_floor_factor(const hil_world_config_t *config, hil_real_t x_m, hil_real_t y_m) {
    hil_real_t factor = 1.0;
    for (uint32_t n = 0; n < config->patch_count; n++) {
        const hil_patch_t *patch = &config->patch[n];
        const hil_real_t dx = x_m - patch->x_m[0], dy = y_m - patch->y_m[0];
        const hil_real_t beyond = patch->radius_m > 0.0
                                      ? dx * dx + dy * dy - patch->radius_m * patch->radius_m
                                      : hil_max(hil_max(-dx, x_m - patch->x_m[1]), hil_max(-dy, y_m - patch->y_m[1]));
        factor = hil_select(beyond > 0.0, factor, patch->friction);
    }
    return factor;
}

/* Each wheel's limit where it stands. @param cos_sin of the heading */
static void hil_floor_patches(hil_world_t *world, const hil_real_t *cos_sin) {
    hil_plant_t *plant = &world->plant;
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        const hil_real_t out_x = cos_sin[0] * plant->along_y[i] + cos_sin[1] * plant->along_x[i];
        const hil_real_t out_y = cos_sin[1] * plant->along_y[i] - cos_sin[0] * plant->along_x[i];
        const hil_real_t x_m = world->pose[0] + out_x * plant->arm_m[i];
        const hil_real_t y_m = world->pose[1] + out_y * plant->arm_m[i];
        plant->inverse_limit_N[i] *= 1.0 / hil_floor_factor(&world->config, x_m, y_m);
    }
}

/* Slope and dry drag of the rollers, in the body frame. */
static void hil_floor_forces(hil_world_t *world) {
    const hil_world_config_t *config = &world->config;
    const hil_plant_t *plant = &world->plant;
    hil_real_t cos_sin[2], uphill[2];
    hil_cos_sin(world->pose[2], cos_sin);
    hil_cos_sin(config->floor_uphill_rad - world->pose[2], uphill);
    const hil_real_t vx = cos_sin[0] * world->twist[0] + cos_sin[1] * world->twist[1];
    const hil_real_t vy = cos_sin[0] * world->twist[1] - cos_sin[1] * world->twist[0];
    world->floor_N[0] = -plant->downhill_N * uphill[0];
    world->floor_N[1] = -plant->downhill_N * uphill[1];
    for (uint32_t i = 0; i < config->wheels; i++) {
        const hil_real_t out_x = plant->along_y[i], out_y = -plant->along_x[i];
        const hil_real_t across_m_s = out_x * vx + out_y * vy;
        const hil_real_t load_N = hil_max(world->load_N[i], plant->weight_N * (LEAST_SHARE / config->wheels));
        const hil_real_t drag_N = plant->dry_drag[i] * load_N * across_m_s /
                                  hil_sqrt(across_m_s * across_m_s + DRY_WIDTH_m_s * DRY_WIDTH_m_s);
        world->floor_N[0] -= drag_N * out_x;
        world->floor_N[1] -= drag_N * out_y;
        world->plant.inverse_limit_N[i] = 1.0 / (plant->friction[i] * load_N);
    }
    if (config->patch_count > 0) {
        hil_floor_patches(world, cos_sin);
    }
}

void hil_floor_step(hil_world_t *world, double step_s) {
    const hil_world_config_t *config = &world->config;
    hil_real_t dip_m[HIL_MAX_WHEELS] = {0.0}, sinking_m_s[HIL_MAX_WHEELS] = {0.0}, traction_N[2];
    for (uint32_t i = 0; i < config->wheels; i++) {
        if (config->rollers_per_row > 0) {
            sinking_m_s[i] = hil_floor_roller(world, i, &dip_m[i]);
        }
        world->load_N[i] = world->plant.weight_N * (config->wheel_stiffness_N_m > 0.0 ? 0.0 : 1.0 / config->wheels);
    }
    if (config->wheel_stiffness_N_m > 0.0) {
        hil_floor_tractions(world, traction_N);
        for (int n = 0; n < PIECES; n++) {
            hil_floor_rise(world, dip_m, sinking_m_s, traction_N, step_s / PIECES);
        }
    }
    hil_floor_forces(world);
}
