/* SPDX-License-Identifier: MIT */
/* Constants of the plants, and what may drive them. */
#include <math.h>

#include "motion.h"
#include "spd3.h"

static void wheels_init(hil_plant_t *plant, const hil_world_config_t *config) {
    double rolling[6] = {0.0};
    for (uint32_t i = 0; i < config->wheels; i++) {
        const double cos_a = cos(config->wheel_angle_rad[i]);
        const double sin_a = sin(config->wheel_angle_rad[i]);
        plant->radius_m[i] = config->wheel_radius_m[i];
        plant->along_x[i] = -sin_a;
        plant->along_y[i] = cos_a;
        plant->arm_m[i] = config->wheel_distance_m[i]; /* (cos, sin) x (-sin, cos) = 1 */
        const double drag_N_s_m = config->roller_friction_N_s_m * config->wheel_drag[i];
        plant->drag_xx += drag_N_s_m * cos_a * cos_a;
        plant->drag_xy += drag_N_s_m * cos_a * sin_a;
        plant->drag_yy += drag_N_s_m * sin_a * sin_a;
        hil_spd3_add(rolling, 1.0, plant->along_x[i], plant->along_y[i], plant->arm_m[i]);
    }
    hil_spd3_factor(&plant->rolling, rolling);
}

void hil_plant_init(hil_plant_t *plant, const hil_world_config_t *config) {
    *plant = (hil_plant_t){0};
    wheels_init(plant, config);
    const double load_N = config->mass_kg * HIL_GRAVITY_m_s2 / config->wheels;
    plant->stiffness_N_s_m = config->slip_stiffness_N_s_m;
    for (uint32_t i = 0; i < config->wheels; i++) {
        plant->friction[i] = config->friction_coefficient * config->wheel_friction[i];
        plant->dry_drag[i] = config->roller_bushing_friction * config->wheel_drag[i];
        plant->inverse_limit_N[i] = 1.0 / (plant->friction[i] * load_N);
    }
    plant->inverse_mass = 1.0 / config->mass_kg;
    plant->inverse_inertia = 1.0 / config->inertia_kg_m2;
    plant->inverse_motor_inertia = 1.0 / config->motor_inertia_kg_m2;
    plant->inverse_inductance = 1.0 / config->motor_inductance_H;
    plant->viscous_N_m_s = config->motor_viscous_N_m_s;
    plant->coulomb_N_m = config->motor_coulomb_N_m;
    plant->battery_resistance_ohm = config->battery_resistance_ohm;
    const hil_plant_model_t *model = hil_plant_model(config->plant);
    if (model->init != NULL) {
        model->init(plant, config);
    }
}

bool hil_plant_accepts_source(uint32_t plant, uint32_t source) {
    const hil_plant_model_t *model = hil_plant_model(plant);
    switch (source) {
    case HIL_SOURCE_SPEED:
        return model->takes_speed;
    case HIL_SOURCE_TORQUE:
        return model->takes_torque;
    default:
        return true;
    }
}
