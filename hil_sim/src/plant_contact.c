/* SPDX-License-Identifier: MIT */
/* What plants full and slip are made of: rigid body, wheels on the floor and winding currents, in the body frame.
 *
 * Creep on the floor is stiff: thousands per second, and more with a heavier grip. Each substep is one step of the
 * two-stage Rosenbrock W-method of Verwer, Spee, Blom and Hundsdorfer (SIAM J. Sci. Comput. 20, 1999): second order
 * whatever the matrix A, damping stiff modes without iteration:
 *
 *     (1 - g h A) k1 = f(y),  (1 - g h A) k2 = f(y + h k1) - 2 k1,  y' = y + 3/2 h k1 + 1/2 h k2,  g = 1 - 1/sqrt 2.
 *
 * A has friction, traction, winding and roller drag. Eliminating current and speed of each wheel leaves three equations
 * of the body. They are solved in newtons: k->v is mass times rate until then.
 *
 * Everything is unrolled over the n wheels, 3 or 4. It is compiled once more for wheels with numbers of their own
 * (hil_wheel_params_t): other runs do not pay for them. */
#include <string.h>

#include "motion.h"
#include "spd3.h"

enum { N = HIL_MAX_WHEELS };
static const double CHOP_s = 25e-6; /* how long a DRV8871 shorts the winding after its trip current */

/* The solved form of (1 - g h A) for one substep. */
typedef struct solver_t {
    hil_real_t speed[N];      /* 1 / diagonal of the wheel's equation */
    hil_real_t from_floor[N]; /* g h r c / J */
    hil_real_t to_body[N];    /* g h c r (1 - s) / diagonal */
    hil_spd3_t body;
} solver_t;

/* What f finds on its way. */
typedef struct slopes_t {
    hil_real_t traction_N[N];
    hil_real_t floor_q[N];   /* 1 / sqrt(1 + (C creep / limit)^2): traction's slope is C q^3 */
    hil_real_t coulomb_q[N]; /* 1 / sqrt(w^2 + w_0^2): friction's slope is T_c w_0^2 q^3 */
    hil_real_t supply_V;
} slopes_t;

HIL_INLINE void prepare(hil_contact_t *c, const hil_world_t *world, const hil_electrics_t *electrics, double step_s,
                        int n) {
    const hil_world_config_t *config = &world->config;
    const hil_plant_t *plant = &world->plant;
    c->h = step_s;
    c->gh = HIL_ROSENBROCK_GAMMA * step_s;
    c->per_inertia = c->gh * plant->inverse_motor_inertia;
    c->torque = c->per_inertia * config->motor_constant_N_m_A;
    c->coulomb_slope = plant->coulomb_N_m * (HIL_COULOMB_WIDTH_rad_s * HIL_COULOMB_WIDTH_rad_s);
    const hil_real_t emf = c->gh * config->motor_constant_N_m_A * plant->inverse_inductance;
    const hil_real_t current = 1.0 / (1.0 + c->gh * config->motor_resistance_ohm * plant->inverse_inductance);
    for (int i = 0; i < n; i++) {
        c->rim_m[i] = plant->radius_m[i] * (1.0 - world->slip_ratio[i]);
        c->inductance[i] = electrics->closed[i] * plant->inverse_inductance;
        c->current[i] = electrics->closed[i] * current;
        c->emf[i] = c->current[i] * emf;
        c->diagonal[i] = 1.0 + c->per_inertia * plant->viscous_N_m_s + c->torque * c->emf[i];
    }
    c->mass[0] = config->mass_kg + c->gh * plant->drag_xx;
    c->mass[1] = c->gh * plant->drag_xy;
    c->mass[3] = config->mass_kg + c->gh * plant->drag_yy;
    c->mass[2] = c->mass[4] = 0.0;
    c->mass[5] = config->inertia_kg_m2;
}

HIL_INLINE void wheel_forces(const hil_world_t *world, const hil_contact_t *c, const hil_motion_t *y, slopes_t *slopes,
                             int n) {
    const hil_plant_t *plant = &world->plant;
    for (int i = 0; i < n; i++) {
        const hil_real_t floor_m_s =
            plant->along_x[i] * y->v[0] + plant->along_y[i] * y->v[1] + plant->arm_m[i] * y->v[2];
        const hil_real_t creep_m_s = c->rim_m[i] * y->w[i] - world->slip_speed_m_s[i] - floor_m_s;
        const hil_real_t linear_N = plant->stiffness_N_s_m * creep_m_s;
        const hil_real_t x = linear_N * plant->inverse_limit_N[i];
        slopes->floor_q[i] = 1.0 / hil_sqrt(1.0 + x * x);
        slopes->traction_N[i] = linear_N * slopes->floor_q[i];
    }
}

HIL_INLINE hil_real_t supply_V(const hil_world_t *world, const hil_electrics_t *electrics, const hil_motion_t *y,
                               int n) {
    hil_real_t load_A = electrics->drive[0] * y->i[0];
    for (int i = 1; i < n; i++) {
        load_A += electrics->drive[i] * y->i[i];
    }
    return hil_max(electrics->battery_V - world->plant.battery_resistance_ohm * load_A, 0.0);
}

HIL_INLINE void wheel_rates(const hil_world_t *world, const hil_electrics_t *electrics, const hil_contact_t *c,
                            const hil_wheel_params_t *own, const hil_motion_t *y, slopes_t *slopes, hil_motion_t *rate,
                            int n) {
    const hil_world_config_t *config = &world->config;
    const hil_plant_t *plant = &world->plant;
    for (int i = 0; i < n; i++) {
        const hil_real_t w = y->w[i];
        const hil_real_t q = 1.0 / hil_sqrt(w * w + HIL_COULOMB_WIDTH_rad_s * HIL_COULOMB_WIDTH_rad_s);
        const hil_real_t constant = own != NULL ? own->constant[i] : config->motor_constant_N_m_A;
        const hil_real_t viscous = own != NULL ? own->viscous[i] : plant->viscous_N_m_s;
        const hil_real_t coulomb = own != NULL ? own->coulomb[i] : plant->coulomb_N_m;
        const hil_real_t inverse_inertia = own != NULL ? own->inverse_inertia[i] : plant->inverse_motor_inertia;
        const hil_real_t friction = (viscous + coulomb * q) * w;
        slopes->coulomb_q[i] = q;
        rate->w[i] = (constant * y->i[i] - friction - plant->radius_m[i] * slopes->traction_N[i]) * inverse_inertia;
        const hil_real_t volts = electrics->gain[i] * slopes->supply_V + electrics->offset_V[i];
        rate->i[i] =
            c->inductance[i] * (volts - config->motor_resistance_ohm * y->i[i] - config->motor_constant_N_m_A * w);
    }
}

HIL_INLINE void body_forces(const hil_world_t *world, const hil_motion_t *y, const slopes_t *slopes, hil_real_t *force,
                            int n) {
    const hil_plant_t *plant = &world->plant;
    /* The frame turns with the body. */
    const hil_real_t turning = world->config.mass_kg * y->v[2];
    force[0] = turning * y->v[1] - plant->drag_xx * y->v[0] - plant->drag_xy * y->v[1];
    force[1] = -turning * y->v[0] - plant->drag_xy * y->v[0] - plant->drag_yy * y->v[1];
    force[2] = 0.0;
    if (plant->uneven) {
        force[0] += world->floor_N[0];
        force[1] += world->floor_N[1];
    }
    for (int i = 0; i < n; i++) {
        force[0] += plant->along_x[i] * slopes->traction_N[i];
        force[1] += plant->along_y[i] * slopes->traction_N[i];
        force[2] += plant->arm_m[i] * slopes->traction_N[i];
    }
}

HIL_INLINE void rates(const hil_world_t *world, const hil_electrics_t *electrics, const hil_contact_t *c,
                      const hil_wheel_params_t *own, const hil_motion_t *y, slopes_t *slopes, hil_motion_t *rate,
                      int n) {
    wheel_forces(world, c, y, slopes, n);
    slopes->supply_V = supply_V(world, electrics, y, n);
    wheel_rates(world, electrics, c, own, y, slopes, rate, n);
    body_forces(world, y, slopes, rate->v, n);
}

HIL_INLINE void factor(solver_t *solver, const hil_world_t *world, const hil_contact_t *c,
                       const hil_wheel_params_t *own, const slopes_t *slopes, int n) {
    const hil_plant_t *plant = &world->plant;
    hil_real_t m[6];
    memcpy(m, c->mass, sizeof m);
    for (int i = 0; i < n; i++) {
        const hil_real_t floor_q = slopes->floor_q[i], coulomb_q = slopes->coulomb_q[i];
        const hil_real_t traction = plant->stiffness_N_s_m * floor_q * (floor_q * floor_q);
        const hil_real_t per_inertia = own != NULL ? own->per_inertia[i] : c->per_inertia;
        const hil_real_t coulomb_slope = own != NULL ? own->coulomb_slope[i] : c->coulomb_slope;
        const hil_real_t coulomb = coulomb_slope * coulomb_q * (coulomb_q * coulomb_q);
        const hil_real_t from_floor = per_inertia * plant->radius_m[i] * traction;
        const hil_real_t held = from_floor * c->rim_m[i];
        const hil_real_t speed = 1.0 / (c->diagonal[i] + per_inertia * coulomb + held);
        const hil_real_t weight = c->gh * traction;
        solver->from_floor[i] = from_floor;
        solver->speed[i] = speed;
        solver->to_body[i] = weight * c->rim_m[i] * speed;
        hil_spd3_add(m, weight * (1.0 - held * speed), plant->along_x[i], plant->along_y[i], plant->arm_m[i]);
    }
    hil_spd3_factor(&solver->body, m);
}

/* In: forces on the body, rates of the wheels; out: rates. */
HIL_INLINE void solve(const solver_t *solver, const hil_contact_t *c, const hil_wheel_params_t *own,
                      const hil_plant_t *plant, hil_motion_t *k, int n) {
    hil_real_t force[3] = {k->v[0], k->v[1], k->v[2]};
    for (int i = 0; i < n; i++) {
        k->i[i] *= c->current[i];
        k->w[i] += (own != NULL ? own->torque[i] : c->torque) * k->i[i];
        const hil_real_t push = solver->to_body[i] * k->w[i];
        force[0] += plant->along_x[i] * push;
        force[1] += plant->along_y[i] * push;
        force[2] += plant->arm_m[i] * push;
    }
    hil_spd3_solve(&solver->body, force, k->v);
    for (int i = 0; i < n; i++) {
        const hil_real_t floor = plant->along_x[i] * k->v[0] + plant->along_y[i] * k->v[1] + plant->arm_m[i] * k->v[2];
        k->w[i] = solver->speed[i] * (k->w[i] + solver->from_floor[i] * floor);
        k->i[i] -= c->emf[i] * k->w[i];
    }
}

/* a + x b for the whole motion. */
HIL_INLINE void add(hil_motion_t *sum, const hil_motion_t *a, hil_real_t x, const hil_motion_t *b, int n) {
    for (int i = 0; i < 3; i++) {
        sum->v[i] = a->v[i] + x * b->v[i];
    }
    for (int i = 0; i < n; i++) {
        sum->w[i] = a->w[i] + x * b->w[i];
        sum->i[i] = a->i[i] + x * b->i[i];
    }
}

/* f(y + h k1) - 2 k1, the body's part as forces. */
HIL_INLINE void second_stage(const hil_world_config_t *config, const hil_motion_t *k1, hil_motion_t *k2, int n) {
    k2->v[0] -= 2.0 * config->mass_kg * k1->v[0];
    k2->v[1] -= 2.0 * config->mass_kg * k1->v[1];
    k2->v[2] -= 2.0 * config->inertia_kg_m2 * k1->v[2];
    for (int i = 0; i < n; i++) {
        k2->w[i] -= 2.0 * k1->w[i];
        k2->i[i] -= 2.0 * k1->i[i];
    }
}

HIL_INLINE void rosenbrock(const hil_world_t *world, const hil_electrics_t *electrics, const hil_contact_t *c,
                           const hil_wheel_params_t *own, hil_motion_t *y, slopes_t *slopes, int n) {
    hil_motion_t k1, k2, stage;
    solver_t solver;
    rates(world, electrics, c, own, y, slopes, &k1, n);
    factor(&solver, world, c, own, slopes, n);
    solve(&solver, c, own, &world->plant, &k1, n);
    add(&stage, y, c->h, &k1, n);
    rates(world, electrics, c, own, &stage, slopes, &k2, n);
    second_stage(&world->config, &k1, &k2, n);
    solve(&solver, c, own, &world->plant, &k2, n);
    add(y, y, 1.5 * c->h, &k1, n);
    add(y, y, 0.5 * c->h, &k2, n);
}

/* A bridge that drives chops at its trip current: the winding is shorted for 25 us, then driven again. What is left in
 * the mean is the trip current less half the ripple. A bridge that brakes does not chop. */
HIL_INLINE void chop(const hil_world_t *world, const hil_electrics_t *electrics, hil_motion_t *y, int n) {
    const hil_world_config_t *config = &world->config;
    for (int i = 0; i < n; i++) {
        const hil_real_t volts = electrics->gain[i] * world->supply_V + electrics->offset_V[i];
        const hil_real_t side = hil_select(volts > 0.0, 1.0, hil_select(volts < 0.0, -1.0, 0.0));
        const hil_real_t falling_V =
            config->motor_resistance_ohm * config->bridge_trip_A + side * config->motor_constant_N_m_A * y->w[i];
        const hil_real_t ripple_A = hil_max(falling_V, 0.0) * world->plant.inverse_inductance * CHOP_s;
        const hil_real_t most_A = hil_max(config->bridge_trip_A - 0.5 * ripple_A, 0.0);
        y->i[i] = hil_select(side * y->i[i] > most_A, side * most_A, y->i[i]);
    }
}

HIL_INLINE void contact_substep(hil_world_t *world, const hil_electrics_t *electrics, const hil_contact_t *c,
                                const hil_wheel_params_t *own, hil_motion_t *y, int n) {
    slopes_t slopes;
    rosenbrock(world, electrics, c, own, y, &slopes, n);
    for (int i = 0; i < n; i++) {
        world->traction_N[i] = slopes.traction_N[i];
    }
    world->supply_V = slopes.supply_V;
    if (world->config.bridge_trip_A > 0.0) {
        chop(world, electrics, y, n);
    }
}

void hil_contact_begin(hil_contact_t *contact, const hil_world_t *world, const hil_electrics_t *electrics,
                       double step_s) {
    if (world->config.wheels == 3) {
        prepare(contact, world, electrics, step_s, 3);
    } else {
        prepare(contact, world, electrics, step_s, 4);
    }
}

void hil_contact_substep(hil_world_t *world, const hil_electrics_t *electrics, const hil_contact_t *contact,
                         hil_motion_t *y) {
    if (world->config.wheels == 3) {
        contact_substep(world, electrics, contact, NULL, y, 3);
    } else {
        contact_substep(world, electrics, contact, NULL, y, 4);
    }
}

void hil_contact_wheel_substep(hil_world_t *world, const hil_electrics_t *electrics, const hil_contact_t *contact,
                               const hil_wheel_params_t *own, hil_motion_t *y) {
    if (world->config.wheels == 3) {
        contact_substep(world, electrics, contact, own, y, 3);
    } else {
        contact_substep(world, electrics, contact, own, y, 4);
    }
}

static void floor_substep(hil_world_t *world, const hil_electrics_t *electrics, const hil_contact_t *contact,
                          hil_motion_t *y, double step_s) {
    (void)step_s;
    hil_contact_substep(world, electrics, contact, y);
}

void hil_contact_step(hil_world_t *world, const hil_electrics_t *electrics, double step_s) {
    hil_integrate_substeps(world, electrics, step_s, NULL, floor_substep);
}
