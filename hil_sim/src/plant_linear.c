/* SPDX-License-Identifier: MIT */
/* Plant linear (14): body-frame velocities with viscous and Coulomb friction, wheels that roll.
 *
 *     M dv/dt = sum over the wheels of (T_i / r_i) (t_i, d_i) - B v - C sgn(v),   T_i = K (V_i - K w_i) / R
 *     r_i w_i (1 - s_i) - u_i = t_i . (v + wz x p_i)
 * B = diag(B_v, B_vn, B_w), C = diag(C_v, C_vn, C_w); M is the body's plus J / (r_i^2 (1 - s_i)) from each wheel. The
 * same Rosenbrock W-method as in plant_contact.c, with friction and back EMF in A, because Coulomb friction is stiff at
 * rest. */
#include <string.h>

#include "motion.h"
#include "spd3.h"

/* M v' = force; damping: -dforce/dv, as the matrices' six numbers. */
typedef struct balance_t {
    hil_real_t force[3];
    hil_real_t mass[6];
    hil_real_t damping[6];
} balance_t;

/* Friction per direction that the motors' friction makes when the body moves along it with rolling wheels. */
static void friction_of_motors(hil_plant_t *plant, const hil_world_config_t *config) {
    for (uint32_t i = 0; i < config->wheels; i++) {
        const hil_real_t per_speed[3] = {plant->along_x[i] / plant->radius_m[i], plant->along_y[i] / plant->radius_m[i],
                                         plant->arm_m[i] / plant->radius_m[i]};
        for (int axis = 0; axis < 3; axis++) {
            plant->linear_viscous[axis] += config->motor_viscous_N_m_s * per_speed[axis] * per_speed[axis];
            plant->linear_coulomb[axis] += config->motor_coulomb_N_m * hil_abs(per_speed[axis]);
        }
    }
    plant->linear_viscous[0] += plant->drag_xx;
    plant->linear_viscous[1] += plant->drag_yy;
}

static void linear_init(hil_plant_t *plant, const hil_world_config_t *config) {
    friction_of_motors(plant, config);
    for (int axis = 0; axis < 3; axis++) {
        if (config->linear_viscous[axis] >= 0.0) {
            plant->linear_viscous[axis] = config->linear_viscous[axis];
        }
        if (config->linear_coulomb[axis] >= 0.0) {
            plant->linear_coulomb[axis] = config->linear_coulomb[axis];
        }
    }
    const hil_real_t width_m_s = HIL_COULOMB_WIDTH_rad_s * plant->radius_m[0];
    plant->coulomb_width[0] = plant->coulomb_width[1] = width_m_s;
    plant->coulomb_width[2] = width_m_s / plant->arm_m[0];
    hil_plant_ignore_losses(plant);
    plant->stiffness_N_s_m = 0.0;
}

/* Wheel speeds of rolling at body velocity v with the imposed slip. */
static void linear_wheels(const hil_world_t *world, const hil_real_t *v, hil_real_t *wheel_rad_s) {
    const hil_plant_t *plant = &world->plant;
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        const hil_real_t grip = 1.0 - world->slip_ratio[i];
        wheel_rad_s[i] = (hil_floor_speed(plant, v, i) + world->slip_speed_m_s[i]) / (plant->radius_m[i] * grip);
    }
}

/* Winding currents without inductance; those that the winding can't change stay. */
static void currents(const hil_world_t *world, const hil_electrics_t *electrics, const hil_real_t *w,
                     hil_real_t *current_A) {
    const hil_world_config_t *config = &world->config;
    for (uint32_t i = 0; i < config->wheels; i++) {
        if (electrics->closed[i] > 0.0) {
            const hil_real_t volts = electrics->gain[i] * electrics->battery_V + electrics->offset_V[i];
            current_A[i] = (volts - config->motor_constant_N_m_A * w[i]) / config->motor_resistance_ohm;
        }
    }
}

static void push_of_wheels(const hil_world_t *world, const hil_electrics_t *electrics, const hil_real_t *v,
                           balance_t *balance) {
    const hil_world_config_t *config = &world->config;
    const hil_plant_t *plant = &world->plant;
    const hil_real_t emf = config->motor_constant_N_m_A * config->motor_constant_N_m_A / config->motor_resistance_ohm;
    hil_real_t w[HIL_MAX_WHEELS], current_A[HIL_MAX_WHEELS];
    memcpy(current_A, world->current_A, sizeof current_A);
    linear_wheels(world, v, w);
    currents(world, electrics, w, current_A);
    for (uint32_t i = 0; i < config->wheels; i++) {
        const hil_real_t x = plant->along_x[i], y = plant->along_y[i], t = plant->arm_m[i];
        const hil_real_t push_N = config->motor_constant_N_m_A * current_A[i] / plant->radius_m[i];
        const hil_real_t reflected = 1.0 / (plant->radius_m[i] * plant->radius_m[i] * (1.0 - world->slip_ratio[i]));
        balance->force[0] += x * push_N;
        balance->force[1] += y * push_N;
        balance->force[2] += t * push_N;
        hil_spd3_add(balance->mass, config->motor_inertia_kg_m2 * reflected, x, y, t);
        hil_spd3_add(balance->damping, electrics->closed[i] * emf * reflected, x, y, t);
    }
}

static void balance_at(const hil_world_t *world, const hil_electrics_t *electrics, const hil_real_t *v,
                       balance_t *balance) {
    static const int DIAGONAL[3] = {0, 3, 5};
    const hil_world_config_t *config = &world->config;
    const hil_plant_t *plant = &world->plant;
    *balance = (balance_t){.mass = {config->mass_kg, 0.0, 0.0, config->mass_kg, 0.0, config->inertia_kg_m2}};
    push_of_wheels(world, electrics, v, balance);
    for (int axis = 0; axis < 3; axis++) {
        const hil_real_t width = plant->coulomb_width[axis];
        const hil_real_t q = 1.0 / hil_sqrt(v[axis] * v[axis] + width * width);
        balance->force[axis] -= plant->linear_viscous[axis] * v[axis] + plant->linear_coulomb[axis] * v[axis] * q;
        balance->damping[DIAGONAL[axis]] +=
            plant->linear_viscous[axis] + plant->linear_coulomb[axis] * width * width * q * q * q;
    }
}

static void times(const hil_real_t *m, const hil_real_t *x, hil_real_t *y) {
    y[0] = m[0] * x[0] + m[1] * x[1] + m[2] * x[2];
    y[1] = m[1] * x[0] + m[3] * x[1] + m[4] * x[2];
    y[2] = m[2] * x[0] + m[4] * x[1] + m[5] * x[2];
}

static void linear_substep(hil_world_t *world, const hil_electrics_t *electrics, const hil_contact_t *contact,
                           hil_motion_t *y, double step_s) {
    (void)contact;
    const hil_real_t gh = HIL_ROSENBROCK_GAMMA * step_s;
    balance_t first, second;
    balance_at(world, electrics, y->v, &first);
    hil_real_t m[6], stage[3], k1[3], k2[3], inertial[3];
    for (int n = 0; n < 6; n++) {
        m[n] = first.mass[n] + gh * first.damping[n];
    }
    hil_spd3_t solver;
    hil_spd3_factor(&solver, m);
    hil_spd3_solve(&solver, first.force, k1);
    for (int axis = 0; axis < 3; axis++) {
        stage[axis] = y->v[axis] + step_s * k1[axis];
    }
    balance_at(world, electrics, stage, &second);
    times(first.mass, k1, inertial);
    for (int axis = 0; axis < 3; axis++) {
        second.force[axis] -= 2.0 * inertial[axis];
    }
    hil_spd3_solve(&solver, second.force, k2);
    for (int axis = 0; axis < 3; axis++) {
        y->v[axis] += step_s * (1.5 * k1[axis] + 0.5 * k2[axis]);
    }
    linear_wheels(world, y->v, y->w);
    currents(world, electrics, y->w, y->i);
    world->supply_V = electrics->battery_V;
}

static void linear_fit(const hil_world_t *world, hil_motion_t *y) {
    linear_wheels(world, y->v, y->w);
}

static void linear_step(hil_world_t *world, const hil_electrics_t *electrics, double step_s) {
    hil_integrate_substeps(world, electrics, step_s, linear_fit, linear_substep);
}

const hil_plant_model_t hil_plant_linear = {.takes_torque = true, .init = linear_init, .step = linear_step};
