/* SPDX-License-Identifier: MIT */
/* Plants full and slip: rigid body, wheels on the floor and winding currents, in the body frame.
 *
 * Creep on the floor is stiff: thousands per second, and more with a heavier grip. Each substep is one step of the two-stage Rosenbrock
 * W-method of Verwer, Spee, Blom and Hundsdorfer (SIAM J. Sci. Comput. 20, 1999): second order whatever the matrix A, damping stiff modes
 * without iteration:
 *     (1 - g h A) k1 = f(y),  (1 - g h A) k2 = f(y + h k1) - 2 k1,  y' = y + 3/2 h k1 + 1/2 h k2,  g = 1 - 1/sqrt 2.
 * A has friction, traction, winding and roller drag. Eliminating current and speed of each wheel leaves three equations of the body. */
#include <math.h>
#include <string.h>

#include "motion.h"
#include "spd3.h"

enum { N = HIL_MAX_WHEELS };

/* The solved form of (1 - g h A) for one substep. */
typedef struct solver_t {
    double gh;
    double current[N];    /* 1 / (1 + g h R / L), 0 for an open winding */
    double emf;           /* g h K / L */
    double torque;        /* g h K / J */
    double speed[N];      /* 1 / diagonal of the wheel's equation */
    double from_floor[N]; /* g h r c / J */
    double to_body[N];    /* g h c r (1 - s) / diagonal */
    hil_spd3_t body;
    double mass[3];
} solver_t;

/* What f leaves behind for A. */
typedef struct slopes_t {
    double traction_N[N];
    double traction[N]; /* dF / dcreep */
    double coulomb[N];  /* dT / dw */
    double supply_V;
} slopes_t;

static void wheel_forces(const hil_world_t *world, const hil_motion_t *y, slopes_t *slopes) {
    const hil_plant_t *plant = &world->plant;
    for (int i = 0; i < N; i++) {
        const double floor_m_s = plant->along_x[i] * y->v[0] + plant->along_y[i] * y->v[1] + plant->arm_m[i] * y->v[2];
        const double linear_N = plant->stiffness_N_s_m * (plant->radius_m[i] * y->w[i] * (1.0 - world->slip_ratio[i]) -
                                                          world->slip_speed_m_s[i] - floor_m_s);
        const double x = linear_N * plant->inverse_limit_N;
        const double q = 1.0 / sqrt(1.0 + x * x);
        slopes->traction_N[i] = linear_N * q;
        slopes->traction[i] = plant->stiffness_N_s_m * q * q * q;
    }
}

static double supply_V(const hil_world_t *world, const hil_electrics_t *electrics, const hil_motion_t *y) {
    double load_A = 0.0;
    for (int i = 0; i < N; i++) {
        load_A += electrics->drive[i] * y->i[i];
    }
    return fmax(electrics->battery_V - world->plant.battery_resistance_ohm * load_A, 0.0);
}

static void wheel_rates(const hil_world_t *world, const hil_electrics_t *electrics, const hil_motion_t *y, slopes_t *slopes,
                        hil_motion_t *rate) {
    const hil_world_config_t *config = &world->config;
    const hil_plant_t *plant = &world->plant;
    for (int i = 0; i < N; i++) {
        const double w = y->w[i];
        const double q = 1.0 / sqrt(w * w + HIL_COULOMB_WIDTH_rad_s * HIL_COULOMB_WIDTH_rad_s);
        const double friction = plant->viscous_N_m_s * w + plant->coulomb_N_m * w * q;
        slopes->coulomb[i] = plant->coulomb_N_m * HIL_COULOMB_WIDTH_rad_s * HIL_COULOMB_WIDTH_rad_s * q * q * q;
        rate->w[i] = (config->motor_constant_N_m_A * y->i[i] - friction - plant->radius_m[i] * slopes->traction_N[i]) *
                     plant->inverse_motor_inertia;
        const double volts = electrics->gain[i] * slopes->supply_V + electrics->offset_V[i];
        rate->i[i] = electrics->closed[i] * plant->inverse_inductance *
                     (volts - config->motor_resistance_ohm * y->i[i] - config->motor_constant_N_m_A * w);
    }
}

static void body_rates(const hil_plant_t *plant, const hil_motion_t *y, const slopes_t *slopes, hil_motion_t *rate) {
    double fx = -plant->drag_xx * y->v[0] - plant->drag_xy * y->v[1];
    double fy = -plant->drag_xy * y->v[0] - plant->drag_yy * y->v[1];
    double torque = 0.0;
    for (int i = 0; i < N; i++) {
        fx += plant->along_x[i] * slopes->traction_N[i];
        fy += plant->along_y[i] * slopes->traction_N[i];
        torque += plant->arm_m[i] * slopes->traction_N[i];
    }
    /* The frame turns with the body. */
    rate->v[0] = fx * plant->inverse_mass + y->v[2] * y->v[1];
    rate->v[1] = fy * plant->inverse_mass - y->v[2] * y->v[0];
    rate->v[2] = torque * plant->inverse_inertia;
}

static void rates(const hil_world_t *world, const hil_electrics_t *electrics, const hil_motion_t *y, slopes_t *slopes,
                  hil_motion_t *rate) {
    wheel_forces(world, y, slopes);
    slopes->supply_V = supply_V(world, electrics, y);
    wheel_rates(world, electrics, y, slopes, rate);
    body_rates(&world->plant, y, slopes, rate);
}

static void factor_wheels(solver_t *solver, const hil_world_t *world, const hil_electrics_t *electrics, const slopes_t *slopes,
                          double *weight) {
    const hil_world_config_t *config = &world->config;
    const hil_plant_t *plant = &world->plant;
    const double gh = solver->gh;
    const double per_inertia = gh * plant->inverse_motor_inertia;
    const double closed = 1.0 / (1.0 + gh * config->motor_resistance_ohm * plant->inverse_inductance);
    for (int i = 0; i < N; i++) {
        const double grip = 1.0 - world->slip_ratio[i];
        const double r = plant->radius_m[i];
        solver->current[i] = closed * electrics->closed[i];
        solver->from_floor[i] = per_inertia * r * slopes->traction[i];
        const double diagonal = 1.0 + per_inertia * (plant->viscous_N_m_s + slopes->coulomb[i]) +
                                solver->from_floor[i] * r * grip + solver->torque * solver->emf * solver->current[i];
        solver->speed[i] = 1.0 / diagonal;
        solver->to_body[i] = gh * slopes->traction[i] * r * grip * solver->speed[i];
        weight[i] = gh * slopes->traction[i] * (1.0 - solver->from_floor[i] * r * grip * solver->speed[i]);
    }
}

static void factor(solver_t *solver, const hil_world_t *world, const hil_electrics_t *electrics, const slopes_t *slopes,
                   double step_s) {
    const hil_world_config_t *config = &world->config;
    const hil_plant_t *plant = &world->plant;
    solver->gh = HIL_ROSENBROCK_GAMMA * step_s;
    solver->emf = solver->gh * config->motor_constant_N_m_A * plant->inverse_inductance;
    solver->torque = solver->gh * config->motor_constant_N_m_A * plant->inverse_motor_inertia;
    double weight[N];
    factor_wheels(solver, world, electrics, slopes, weight);
    double m[6] = {config->mass_kg + solver->gh * plant->drag_xx,
                   solver->gh * plant->drag_xy,
                   0.0,
                   config->mass_kg + solver->gh * plant->drag_yy,
                   0.0,
                   config->inertia_kg_m2};
    for (int i = 0; i < N; i++) {
        hil_spd3_add(m, weight[i], plant->along_x[i], plant->along_y[i], plant->arm_m[i]);
    }
    hil_spd3_factor(&solver->body, m);
    solver->mass[0] = solver->mass[1] = config->mass_kg;
    solver->mass[2] = config->inertia_kg_m2;
}

static void solve(const solver_t *solver, const hil_plant_t *plant, hil_motion_t *k) {
    double b[3] = {solver->mass[0] * k->v[0], solver->mass[1] * k->v[1], solver->mass[2] * k->v[2]};
    for (int i = 0; i < N; i++) {
        k->i[i] *= solver->current[i];
        k->w[i] += solver->torque * k->i[i];
        const double push = solver->to_body[i] * k->w[i];
        b[0] += plant->along_x[i] * push;
        b[1] += plant->along_y[i] * push;
        b[2] += plant->arm_m[i] * push;
    }
    hil_spd3_solve(&solver->body, b, k->v);
    for (int i = 0; i < N; i++) {
        const double floor = plant->along_x[i] * k->v[0] + plant->along_y[i] * k->v[1] + plant->arm_m[i] * k->v[2];
        k->w[i] = solver->speed[i] * (k->w[i] + solver->from_floor[i] * floor);
        k->i[i] -= solver->current[i] * solver->emf * k->w[i];
    }
}

/* a + x b for the whole motion. */
static void add(hil_motion_t *sum, const hil_motion_t *a, double x, const hil_motion_t *b) {
    for (int i = 0; i < 3; i++) {
        sum->v[i] = a->v[i] + x * b->v[i];
    }
    for (int i = 0; i < N; i++) {
        sum->w[i] = a->w[i] + x * b->w[i];
        sum->i[i] = a->i[i] + x * b->i[i];
    }
}

static void rosenbrock(const hil_world_t *world, const hil_electrics_t *electrics, hil_motion_t *y, slopes_t *slopes,
                       double step_s) {
    hil_motion_t k1, k2, stage;
    solver_t solver;
    rates(world, electrics, y, slopes, &k1);
    factor(&solver, world, electrics, slopes, step_s);
    solve(&solver, &world->plant, &k1);
    add(&stage, y, step_s, &k1);
    rates(world, electrics, &stage, slopes, &k2);
    add(&k2, &k2, -2.0, &k1);
    solve(&solver, &world->plant, &k2);
    add(y, y, 1.5 * step_s, &k1);
    add(y, y, 0.5 * step_s, &k2);
}

void hil_contact_substep(hil_world_t *world, const hil_electrics_t *electrics, hil_motion_t *y, double step_s) {
    slopes_t slopes = {{0.0}, {0.0}, {0.0}, 0.0};
    rosenbrock(world, electrics, y, &slopes, step_s);
    memcpy(world->traction_N, slopes.traction_N, sizeof world->traction_N);
    world->supply_V = slopes.supply_V;
}
