/* SPDX-License-Identifier: MIT */
/* Rigid body, wheels and winding currents, in the body frame.
 *
 * Creep on the floor is stiff: thousands per second, and more with a heavier grip. Each substep is one step of the two-stage Rosenbrock
 * W-method of Verwer, Spee, Blom and Hundsdorfer (SIAM J. Sci. Comput. 20, 1999): second order whatever the matrix A, damping stiff modes
 * without iteration:
 *     (1 - g h A) k1 = f(y),  (1 - g h A) k2 = f(y + h k1) - 2 k1,  y' = y + 3/2 h k1 + 1/2 h k2,  g = 1 - 1/sqrt 2.
 * A has friction, traction, winding and roller drag. Eliminating current and speed of each wheel leaves three equations of the body. */
#include <math.h>

#include "parts.h"

static const double GRAVITY_m_s2 = 9.80665;
static const double ROSENBROCK_GAMMA = 0.29289321881345254;
static const double COULOMB_WIDTH_rad_s = 0.01;
static const double SUBSTEP_MAX_s = 0.25e-3;

enum { N = HIL_MAX_WHEELS };

typedef struct motion_t {
    double v[3]; /* body frame: vx, vy, wz */
    double w[N];
    double i[N];
} motion_t;

/* The solved form of (1 - g h A) for one substep. */
typedef struct solver_t {
    double gh;
    double current[N];    /* 1 / (1 + g h R / L), 0 for an open winding */
    double emf;           /* g h K / L */
    double torque;        /* g h K / J */
    double speed[N];      /* 1 / diagonal of the wheel's equation */
    double from_floor[N]; /* g h r c / J */
    double to_body[N];    /* g h c r (1 - s) / diagonal */
    double inv_d[3];      /* L D L' of the body's matrix */
    double l10, l20, l21;
    double mass[3];
} solver_t;

/* What f leaves behind for A. */
typedef struct slopes_t {
    double traction_N[N];
    double traction[N]; /* dF / dcreep */
    double coulomb[N];  /* dT / dw */
    double supply_V;
} slopes_t;

void hil_plant_init(hil_plant_t *plant, const hil_world_config_t *config) {
    *plant = (hil_plant_t){0};
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
    }
    const double load_N = config->mass_kg * GRAVITY_m_s2 / config->wheels;
    plant->stiffness_N_s_m = config->slip_stiffness_N_s_m;
    plant->inverse_limit_N = 1.0 / (config->friction_coefficient * load_N);
    plant->inverse_mass = 1.0 / config->mass_kg;
    plant->inverse_inertia = 1.0 / config->inertia_kg_m2;
    plant->inverse_motor_inertia = 1.0 / config->motor_inertia_kg_m2;
    plant->inverse_inductance = 1.0 / config->motor_inductance_H;
}

static void wheel_forces(const hil_world_t *world, const motion_t *y, slopes_t *slopes) {
    const hil_plant_t *plant = &world->plant;
    for (int i = 0; i < N; i++) {
        const double floor_m_s = plant->along_x[i] * y->v[0] + plant->along_y[i] * y->v[1] + plant->arm_m[i] * y->v[2];
        const double linear_N =
            plant->stiffness_N_s_m * (plant->radius_m[i] * y->w[i] * (1.0 - world->slip_ratio[i]) - floor_m_s);
        const double x = linear_N * plant->inverse_limit_N;
        const double q = 1.0 / sqrt(1.0 + x * x);
        slopes->traction_N[i] = linear_N * q;
        slopes->traction[i] = plant->stiffness_N_s_m * q * q * q;
    }
}

static double supply_V(const hil_world_t *world, const hil_electrics_t *electrics, const motion_t *y) {
    double load_A = 0.0;
    for (int i = 0; i < N; i++) {
        load_A += electrics->drive[i] * y->i[i];
    }
    return fmax(electrics->battery_V - world->config.battery_resistance_ohm * load_A, 0.0);
}

static void wheel_rates(const hil_world_t *world, const hil_electrics_t *electrics, const motion_t *y, slopes_t *slopes,
                        motion_t *rate) {
    const hil_world_config_t *config = &world->config;
    const hil_plant_t *plant = &world->plant;
    for (int i = 0; i < N; i++) {
        const double w = y->w[i];
        const double q = 1.0 / sqrt(w * w + COULOMB_WIDTH_rad_s * COULOMB_WIDTH_rad_s);
        const double friction = config->motor_viscous_N_m_s * w + config->motor_coulomb_N_m * w * q;
        slopes->coulomb[i] = config->motor_coulomb_N_m * COULOMB_WIDTH_rad_s * COULOMB_WIDTH_rad_s * q * q * q;
        rate->w[i] = (config->motor_constant_N_m_A * y->i[i] - friction - plant->radius_m[i] * slopes->traction_N[i]) *
                     plant->inverse_motor_inertia;
        const double volts = electrics->gain[i] * slopes->supply_V + electrics->offset_V[i];
        rate->i[i] = electrics->closed[i] * plant->inverse_inductance *
                     (volts - config->motor_resistance_ohm * y->i[i] - config->motor_constant_N_m_A * w);
    }
}

static void body_rates(const hil_plant_t *plant, const motion_t *y, const slopes_t *slopes, motion_t *rate) {
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

static void rates(const hil_world_t *world, const hil_electrics_t *electrics, const motion_t *y, slopes_t *slopes,
                  motion_t *rate) {
    wheel_forces(world, y, slopes);
    slopes->supply_V = supply_V(world, electrics, y);
    wheel_rates(world, electrics, y, slopes, rate);
    body_rates(&world->plant, y, slopes, rate);
}

static void factor_body(solver_t *solver, const double *m) {
    /* m: xx, xy, xt, yy, yt, tt of a symmetric positive definite matrix */
    solver->inv_d[0] = 1.0 / m[0];
    solver->l10 = m[1] * solver->inv_d[0];
    solver->l20 = m[2] * solver->inv_d[0];
    solver->inv_d[1] = 1.0 / (m[3] - solver->l10 * m[1]);
    const double left = m[4] - solver->l10 * m[2];
    solver->l21 = left * solver->inv_d[1];
    solver->inv_d[2] = 1.0 / (m[5] - solver->l20 * m[2] - solver->l21 * left);
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
        const double diagonal = 1.0 + per_inertia * (config->motor_viscous_N_m_s + slopes->coulomb[i]) +
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
    solver->gh = ROSENBROCK_GAMMA * step_s;
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
        const double x = plant->along_x[i], y = plant->along_y[i], t = plant->arm_m[i];
        m[0] += weight[i] * x * x;
        m[1] += weight[i] * x * y;
        m[2] += weight[i] * x * t;
        m[3] += weight[i] * y * y;
        m[4] += weight[i] * y * t;
        m[5] += weight[i] * t * t;
    }
    factor_body(solver, m);
    solver->mass[0] = solver->mass[1] = config->mass_kg;
    solver->mass[2] = config->inertia_kg_m2;
}

static void solve(const solver_t *solver, const hil_plant_t *plant, motion_t *k) {
    double b[3] = {solver->mass[0] * k->v[0], solver->mass[1] * k->v[1], solver->mass[2] * k->v[2]};
    for (int i = 0; i < N; i++) {
        k->i[i] *= solver->current[i];
        k->w[i] += solver->torque * k->i[i];
        const double push = solver->to_body[i] * k->w[i];
        b[0] += plant->along_x[i] * push;
        b[1] += plant->along_y[i] * push;
        b[2] += plant->arm_m[i] * push;
    }
    b[1] -= solver->l10 * b[0];
    b[2] -= solver->l20 * b[0] + solver->l21 * b[1];
    k->v[2] = b[2] * solver->inv_d[2];
    k->v[1] = b[1] * solver->inv_d[1] - solver->l21 * k->v[2];
    k->v[0] = b[0] * solver->inv_d[0] - solver->l10 * k->v[1] - solver->l20 * k->v[2];
    for (int i = 0; i < N; i++) {
        const double floor = plant->along_x[i] * k->v[0] + plant->along_y[i] * k->v[1] + plant->arm_m[i] * k->v[2];
        k->w[i] = solver->speed[i] * (k->w[i] + solver->from_floor[i] * floor);
        k->i[i] -= solver->current[i] * solver->emf * k->w[i];
    }
}

/* a + x b for the whole motion. */
static void add(motion_t *sum, const motion_t *a, double x, const motion_t *b) {
    for (int i = 0; i < 3; i++) {
        sum->v[i] = a->v[i] + x * b->v[i];
    }
    for (int i = 0; i < N; i++) {
        sum->w[i] = a->w[i] + x * b->w[i];
        sum->i[i] = a->i[i] + x * b->i[i];
    }
}

static void rosenbrock(const hil_world_t *world, const hil_electrics_t *electrics, motion_t *y, slopes_t *slopes,
                       double step_s) {
    motion_t k1, k2, stage;
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
static void advance(hil_world_t *world, const motion_t *before, const motion_t *after, double step_s, double *cos_sin) {
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

static void load(const hil_world_t *world, motion_t *y, const double *cos_sin) {
    y->v[0] = cos_sin[0] * world->twist[0] + cos_sin[1] * world->twist[1];
    y->v[1] = cos_sin[0] * world->twist[1] - cos_sin[1] * world->twist[0];
    y->v[2] = world->twist[2];
    for (int i = 0; i < N; i++) {
        y->w[i] = world->wheel_rad_s[i];
        y->i[i] = world->current_A[i];
    }
}

static void store(hil_world_t *world, const motion_t *y, const slopes_t *slopes, const double *cos_sin) {
    world->twist[0] = cos_sin[0] * y->v[0] - cos_sin[1] * y->v[1];
    world->twist[1] = cos_sin[1] * y->v[0] + cos_sin[0] * y->v[1];
    world->twist[2] = y->v[2];
    for (int i = 0; i < N; i++) {
        world->wheel_rad_s[i] = y->w[i];
        world->current_A[i] = y->i[i];
        world->traction_N[i] = slopes->traction_N[i];
    }
    world->supply_V = slopes->supply_V;
}

void hil_plant_step(hil_world_t *world, const hil_electrics_t *electrics, double step_s) {
    const int substeps = 1 + (int)((step_s - 1e-9) / SUBSTEP_MAX_s);
    const double substep_s = step_s / substeps;
    double cos_sin[2] = {cos(world->pose[2]), sin(world->pose[2])};
    motion_t y;
    slopes_t slopes = {{0.0}, {0.0}, {0.0}, 0.0};
    load(world, &y, cos_sin);
    for (int n = 0; n < substeps; n++) {
        const motion_t before = y;
        rosenbrock(world, electrics, &y, &slopes, substep_s);
        advance(world, &before, &y, substep_s, cos_sin);
    }
    store(world, &y, &slopes, cos_sin);
}
