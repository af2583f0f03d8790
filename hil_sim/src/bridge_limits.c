/* SPDX-License-Identifier: MIT */
/* What protects bridges, motors and supply, and what makes them warm. For plants full and slip; each is off by default.
 *
 *   overcurrent: |i| > I: the bridge opens for 3 ms, the current dies through its diodes, then it tries again
 *   bridge:  T' = (R_th R_on i^2 - T) / tau; at T_off it opens until it is 40 K cooler
 *   winding: T' = (R_th R i^2 - T) / tau
 *   supply:  C V' = I - load while it gives no more than I, up to its open-circuit voltage
 *
 * T is above the room. All this happens between two substeps. A bridge opens where a straight line between two currents
 * reaches the limit, and closes at the end of the nearest substep. The bridge's resistance is part of the motor's
 * (motor_resistance_ohm). A warm winding keeps its resistance. */
#include "hil_sim/drv8871.h"
#include "motion.h"

static const double RETRY_s = 3e-3;   /* DRV8871 data sheet: t_RETRY */
static const double COOLER_K = 40.0;  /* the same: hysteresis of the thermal shutdown */
static const double LEAST_A = 1e-300; /* keeps a share of nothing finite */

void hil_limits_init(hil_plant_t *plant, const hil_world_config_t *config) {
    plant->limits = config->bridge_overcurrent_A > 0.0 || config->bridge_thermal_K_W > 0.0 ||
                    config->winding_thermal_K_W > 0.0 || config->supply_limit_A > 0.0;
}

/* The winding of a bridge that is off, in the wheel's direction. */
static hil_real_t let_die(const hil_world_t *world, const hil_motion_t *y, uint32_t wheel, hil_real_t time_s,
                          hil_real_t *current_A) {
    const hil_world_config_t *config = &world->config;
    const hil_winding_t winding = {config->motor_resistance_ohm, config->motor_inductance_H,
                                   config->motor_constant_N_m_A * y->w[wheel]};
    return hil_drv8871_freewheel(&winding, world->supply_V, time_s, current_A);
}

static void open_bridge(hil_world_t *world, hil_limited_electrics_t *now, hil_motion_t *y, uint32_t i, double step_s) {
    const hil_real_t on = hil_select(world->bridge_rest_s[i] > 0.5 * step_s, 0.0, 1.0 - world->bridge_off[i]);
    hil_real_t end_A = y->i[i];
    const hil_real_t mean_A = let_die(world, y, i, step_s, &end_A);
    now->opened[i] = hil_select(now->electrics.closed[i] > on, 1.0, 0.0);
    y->i[i] = hil_select(now->opened[i] > 0.0, mean_A, y->i[i]);
    now->end_A[i] = end_A;
    now->electrics.closed[i] *= on;
    now->electrics.gain[i] *= on;
    now->electrics.offset_V[i] *= on;
    now->electrics.drive[i] *= on;
    world->bridge_rest_s[i] = hil_max(world->bridge_rest_s[i] - step_s, 0.0);
}

void hil_limits_before_substep(hil_world_t *world, const hil_electrics_t *electrics, hil_motion_t *y, double step_s,
                               hil_limited_electrics_t *now) {
    now->electrics = *electrics;
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        open_bridge(world, now, y, i, step_s);
        now->begin_A[i] = y->i[i];
    }
    if (world->config.supply_limit_A > 0.0) {
        now->electrics.battery_V = hil_min(world->source_V, electrics->battery_V);
    }
}

static void trip(hil_world_t *world, const hil_limited_electrics_t *now, hil_motion_t *y, uint32_t i, double step_s) {
    const double most_A = world->config.bridge_overcurrent_A;
    const hil_real_t before_A = hil_min(hil_abs(now->begin_A[i]), most_A);
    const hil_real_t rise_A = hil_max(hil_abs(y->i[i]) - before_A, LEAST_A);
    const hil_real_t left_s = hil_max(hil_abs(y->i[i]) - most_A, 0.0) / rise_A * step_s;
    const hil_real_t trips = hil_select(now->electrics.closed[i] * left_s > 0.0, 1.0, 0.0);
    hil_real_t end_A = hil_copysign(most_A, y->i[i]);
    (void)let_die(world, y, i, hil_max(left_s, 1e-9), &end_A);
    y->i[i] = hil_select(trips > 0.0, end_A, y->i[i]);
    world->bridge_rest_s[i] = hil_select(trips > 0.0, RETRY_s - left_s, world->bridge_rest_s[i]);
    world->bridge_trips[i] += trips;
}

static void warm_up(hil_world_t *world, const hil_motion_t *y, uint32_t i, double step_s) {
    const hil_world_config_t *config = &world->config;
    const hil_real_t square = y->i[i] * y->i[i];
    const hil_real_t bridge_K = config->bridge_thermal_K_W * config->bridge_resistance_ohm * square;
    const hil_real_t winding_K = config->winding_thermal_K_W * config->motor_resistance_ohm * square;
    world->bridge_K[i] += (1.0 - hil_exp(-step_s / config->bridge_thermal_s)) * (bridge_K - world->bridge_K[i]);
    world->winding_K[i] += (1.0 - hil_exp(-step_s / config->winding_thermal_s)) * (winding_K - world->winding_K[i]);
    const hil_real_t kept =
        hil_select(world->bridge_K[i] < config->bridge_shutdown_K - COOLER_K, 0.0, world->bridge_off[i]);
    const hil_real_t off = hil_select(world->bridge_K[i] >= config->bridge_shutdown_K, 1.0, kept);
    world->bridge_trips[i] += hil_max(off - world->bridge_off[i], 0.0);
    world->bridge_off[i] = off;
}

/* The currents at the substep's end decide: so it does not swing up. */
static void drain(hil_world_t *world, const hil_limited_electrics_t *now, const hil_motion_t *y, hil_real_t battery_V,
                  double step_s) {
    hil_real_t load_A = 0.0;
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        load_A += now->electrics.drive[i] * y->i[i];
    }
    const hil_real_t change_V = step_s / world->config.supply_capacitance_F * (world->config.supply_limit_A - load_A);
    world->source_V = hil_max(hil_min(now->electrics.battery_V + change_V, battery_V), 0.0);
}

void hil_limits_after_substep(hil_world_t *world, const hil_electrics_t *electrics, hil_limited_electrics_t *now,
                              hil_motion_t *y, double step_s) {
    for (uint32_t i = 0; i < world->config.wheels; i++) {
        if (world->config.bridge_overcurrent_A > 0.0) {
            trip(world, now, y, i, step_s);
        }
        warm_up(world, y, i, step_s);
        y->i[i] = hil_select(now->opened[i] > 0.0, now->end_A[i], y->i[i]);
    }
    if (world->config.supply_limit_A > 0.0) {
        drain(world, now, y, electrics->battery_V, step_s);
    }
}
