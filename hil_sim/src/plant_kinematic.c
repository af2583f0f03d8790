/* SPDX-License-Identifier: MIT */
/* Rolling with imposed slip (15)-(23): body velocity from the wheels' speeds.
 *
 * Every contact says r w_i (1 - s_i) - u_i = t_i . (v + wz x p_i). Three wheels say it exactly; four contradict each
 * other by what slips, and the velocity in between is the one of least squares. */
#include <string.h>

#include "motion.h"
#include "spd3.h"

void hil_rolling_twist(const hil_world_t *world, const hil_real_t *wheel_rad_s, hil_real_t *v) {
    const hil_plant_t *plant = &world->plant;
    hil_real_t b[3] = {0.0};
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        const hil_real_t rolled_m_s =
            plant->radius_m[i] * wheel_rad_s[i] * (1.0 - world->slip_ratio[i]) - world->slip_speed_m_s[i];
        b[0] += plant->along_x[i] * rolled_m_s;
        b[1] += plant->along_y[i] * rolled_m_s;
        b[2] += plant->arm_m[i] * rolled_m_s;
    }
    hil_spd3_solve(&plant->rolling, b, v);
}

/* The steady state of (24), (25) without load: K i = b w, V = R i + K w. */
static void steady_wheels(hil_world_t *world, const hil_electrics_t *electrics, hil_motion_t *y) {
    const hil_world_config_t *config = &world->config;
    const hil_real_t amperes_per_speed = config->motor_viscous_N_m_s / config->motor_constant_N_m_A;
    const hil_real_t volts_per_speed = config->motor_constant_N_m_A + config->motor_resistance_ohm * amperes_per_speed;
    for (uint32_t i = 0; i < config->wheels; i++) {
        const hil_real_t volts = electrics->gain[i] * electrics->battery_V + electrics->offset_V[i];
        y->w[i] = electrics->closed[i] * volts / volts_per_speed;
        y->i[i] = electrics->closed[i] * y->w[i] * amperes_per_speed;
    }
}

/* Constant body velocity turns the body along an arc of a circle: heading in the middle, chord instead of arc. */
static void advance_arc(hil_world_t *world, const hil_real_t *v, double step_s) {
    const hil_real_t half_rad = 0.5 * step_s * v[2];
    hil_real_t half[2], heading[2];
    hil_cos_sin(half_rad, half);
    hil_cos_sin(world->pose[2] + half_rad, heading);
    const hil_real_t chord = hil_select(hil_abs(half_rad) < 1e-4, 1.0 - half_rad * half_rad / 6.0, half[1] / half_rad);
    const hil_real_t c = step_s * chord * heading[0];
    const hil_real_t s = step_s * chord * heading[1];
    world->pose[0] += c * v[0] - s * v[1];
    world->pose[1] += s * v[0] + c * v[1];
    world->pose[2] += 2.0 * half_rad;
}

static void kinematic_init(hil_plant_t *plant, const hil_world_config_t *config) {
    (void)config;
    hil_plant_ignore_losses(plant);
    plant->stiffness_N_s_m = 0.0;
}

static void kinematic_step(hil_world_t *world, const hil_electrics_t *electrics, double step_s) {
    hil_motion_t y = {{0.0}, {0.0}, {0.0}};
    if (world->source == HIL_SOURCE_SPEED) {
        memcpy(y.w, world->driven, sizeof y.w);
    } else {
        steady_wheels(world, electrics, &y);
    }
    hil_rolling_twist(world, y.w, y.v);
    advance_arc(world, y.v, step_s);
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        world->wheel_angle_rad[i] += step_s * y.w[i];
    }
    hil_real_t cos_sin[2];
    hil_cos_sin(world->pose[2], cos_sin);
    hil_motion_store(world, &y, cos_sin);
    world->supply_V = electrics->battery_V;
}

const hil_plant_model_t hil_plant_kinematic = {.takes_speed = true, .init = kinematic_init, .step = kinematic_step};
