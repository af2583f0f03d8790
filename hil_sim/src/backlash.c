/* SPDX-License-Identifier: MIT */
/* Play of the gears, for plant full: motor and wheel turn by themselves until the teeth meet.
 *
 * gap_rad is how far the motor is ahead of its wheel, within half the play on either side. mesh says which flanks
 * touch. At 1 the motor pushes the wheel counter-clockwise, at -1 clockwise; at 0 none touch.
 *
 *   meshed:   J w' = K i - b w - T_c(w) - r F, one speed, as in plant_contact.c
 *   free:     (1 - s) J wm' = K i - b wm - T_c(wm),  s J w' = -r F,  gap' = wm - w
 *   they meet:  w+ = (1 - s) wm + s w: the flanks do not bounce, momentum stays
 *   they part:  when the flanks would have to pull: mesh (K i - b w - T_c(w) - (1 - s) J w') < 0
 *
 * s is the wheel's share of the inertia. All friction is in motor and gear. The battery sees the current that a free
 * motor had at the start of the substep. Flanks meet and part between substeps, so at most 0.25 ms late. */
#include "motion.h"

/* A wheel whose gear is meshed has its motor's inertia, torque and friction; a free one has none of them. */
static void hil_backlash_contact(const hil_world_t *world, hil_contact_t *c, hil_wheel_params_t *own) {
    const hil_plant_t *plant = &world->plant;
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        const hil_real_t meshed = world->mesh[i] * world->mesh[i];
        own->inverse_inertia[i] = hil_select(meshed > 0.0, plant->inverse_motor_inertia, plant->inverse_wheel_inertia);
        own->constant[i] = meshed * world->config.motor_constant_N_m_A;
        own->viscous[i] = meshed * plant->viscous_N_m_s;
        own->coulomb[i] = meshed * plant->coulomb_N_m;
        own->per_inertia[i] = c->gh * own->inverse_inertia[i];
        own->torque[i] = own->per_inertia[i] * own->constant[i];
        own->coulomb_slope[i] = own->coulomb[i] * (HIL_COULOMB_WIDTH_rad_s * HIL_COULOMB_WIDTH_rad_s);
        c->inductance[i] *= meshed;
        c->current[i] *= meshed;
        c->emf[i] *= meshed;
        c->diagonal[i] = 1.0 + own->per_inertia[i] * own->viscous[i] + own->torque[i] * c->emf[i];
    }
}

/* Slope of a free motor's speed, and what it says of its friction. */
static hil_real_t hil_backlash_slope(const hil_world_t *world, hil_real_t w, hil_real_t current_A, hil_real_t *slope) {
    const hil_plant_t *plant = &world->plant;
    const hil_real_t width = HIL_COULOMB_WIDTH_rad_s;
    const hil_real_t q = 1.0 / hil_sqrt(w * w + width * width);
    *slope = plant->viscous_N_m_s + plant->coulomb_N_m * (width * width) * q * (q * q);
    return world->config.motor_constant_N_m_A * current_A - (plant->viscous_N_m_s + plant->coulomb_N_m * q) * w;
}

/* A substep of wheel i's motor without its wheel, by the method of plant_contact.c. In and out: speed and current. */
static void hil_backlash_motor(const hil_world_t *world, const hil_electrics_t *electrics, const hil_contact_t *c,
                               uint32_t i, hil_real_t *motor_rad_s, hil_real_t *current_A) {
    const hil_world_config_t *config = &world->config;
    const hil_real_t volts = electrics->gain[i] * world->supply_V + electrics->offset_V[i];
    const hil_real_t inverse_inertia = world->plant.inverse_rotor_inertia;
    const hil_real_t per_inertia = c->gh * inverse_inertia;
    const hil_real_t torque = per_inertia * config->motor_constant_N_m_A;
    hil_real_t w = *motor_rad_s, current = *current_A, slope, unused, k_w = 0.0, k_i = 0.0, first_w, first_i;
    hil_real_t rate_w = inverse_inertia * hil_backlash_slope(world, w, current, &slope);
    hil_real_t rate_i =
        c->inductance[i] * (volts - config->motor_resistance_ohm * current - config->motor_constant_N_m_A * w);
    const hil_real_t pivot = 1.0 / (1.0 + per_inertia * slope + torque * c->emf[i]);
    k_i = c->current[i] * rate_i;
    k_w = pivot * (rate_w + torque * k_i);
    k_i -= c->emf[i] * k_w;
    first_w = k_w;
    first_i = k_i;
    w += c->h * first_w;
    current += c->h * first_i;
    rate_w = inverse_inertia * hil_backlash_slope(world, w, current, &unused) - 2.0 * first_w;
    rate_i = c->inductance[i] * (volts - config->motor_resistance_ohm * current - config->motor_constant_N_m_A * w) -
             2.0 * first_i;
    k_i = c->current[i] * rate_i;
    k_w = pivot * (rate_w + torque * k_i);
    k_i -= c->emf[i] * k_w;
    *motor_rad_s += 1.5 * c->h * first_w + 0.5 * c->h * k_w;
    *current_A += 1.5 * c->h * first_i + 0.5 * c->h * k_i;
}

/* Which flanks touch after a substep that began with `before` and speed `motor_before` of the motor. */
static void hil_backlash_mesh(hil_world_t *world, const hil_motion_t *before, hil_motion_t *y, uint32_t i,
                              hil_real_t motor_before, double step_s) {
    const hil_world_config_t *config = &world->config;
    const hil_real_t share = config->wheel_inertia_share;
    const double half = 0.5 * config->backlash_rad;
    const hil_real_t mesh = world->mesh[i], motor = world->motor_rad_s[i];
    const hil_real_t mean_w = 0.5 * (before->w[i] + y->w[i]);
    hil_real_t unused;
    const hil_real_t given_N_m = hil_backlash_slope(world, mean_w, 0.5 * (before->i[i] + y->i[i]), &unused);
    const hil_real_t taken_N_m =
        (1.0 - share) * config->motor_inertia_kg_m2 * (y->w[i] - before->w[i]) * (1.0 / step_s);
    const hil_real_t held = hil_select(mesh * (given_N_m - taken_N_m) < 0.0, 0.0, mesh);
    const hil_real_t gap = world->gap_rad[i] + 0.5 * step_s * (motor_before - before->w[i] + motor - y->w[i]);
    const hil_real_t ahead = hil_select(motor > y->w[i], 1.0, 0.0);
    const hil_real_t behind = hil_select(motor < y->w[i], -1.0, 0.0);
    const hil_real_t met = hil_select(gap >= half, ahead, hil_select(gap <= -half, behind, 0.0));
    const hil_real_t free = 1.0 - mesh * mesh;
    world->gap_rad[i] = hil_select(free > 0.0, hil_max(hil_min(gap, half), -half), world->gap_rad[i]);
    y->w[i] = hil_select(free * met * met > 0.0, (1.0 - share) * motor + share * y->w[i], y->w[i]);
    world->mesh[i] = hil_select(free > 0.0, met, held);
    world->motor_rad_s[i] = hil_select(free * (1.0 - met * met) > 0.0, motor, y->w[i]);
}

static void hil_backlash_substep(hil_world_t *world, const hil_electrics_t *electrics, const hil_contact_t *contact,
                                 hil_motion_t *y, double step_s) {
    const hil_motion_t before = *y;
    hil_contact_t c = *contact;
    hil_wheel_params_t own;
    hil_backlash_contact(world, &c, &own);
    hil_contact_wheel_substep(world, electrics, &c, &own, y);
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        const hil_real_t free = 1.0 - world->mesh[i] * world->mesh[i];
        const hil_real_t motor_before = hil_select(free > 0.0, world->motor_rad_s[i], before.w[i]);
        hil_real_t motor = motor_before, current = y->i[i];
        hil_backlash_motor(world, electrics, contact, i, &motor, &current);
        world->motor_rad_s[i] = hil_select(free > 0.0, motor, y->w[i]);
        y->i[i] = hil_select(free > 0.0, current, y->i[i]);
        hil_backlash_mesh(world, &before, y, i, motor_before, step_s);
    }
}

void hil_backlash_init(hil_plant_t *plant, const hil_world_config_t *config) {
    plant->play = config->backlash_rad > 0.0;
    plant->inverse_wheel_inertia = plant->inverse_motor_inertia / config->wheel_inertia_share;
    plant->inverse_rotor_inertia = plant->inverse_motor_inertia / (1.0 - config->wheel_inertia_share);
}

void hil_backlash_step(hil_world_t *world, const hil_electrics_t *electrics, double step_s) {
    hil_integrate_substeps(world, electrics, step_s, NULL, hil_backlash_substep);
}

void hil_backlash_shift(hil_world_t *world, uint32_t wheel, hil_real_t moved_rad) {
    const double half = 0.5 * world->config.backlash_rad;
    const hil_real_t mesh = world->mesh[wheel];
    const hil_real_t gap = world->gap_rad[wheel] - (1.0 - mesh * mesh) * moved_rad;
    const hil_real_t met = hil_select(gap > half, 1.0, hil_select(gap < -half, -1.0, mesh));
    world->gap_rad[wheel] = hil_max(hil_min(gap, half), -half);
    world->mesh[wheel] = met;
    world->motor_rad_s[wheel] = hil_select(met * met > 0.0, world->wheel_rad_s[wheel], world->motor_rad_s[wheel]);
}
