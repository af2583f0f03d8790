/* SPDX-License-Identifier: MIT */
#include "hil_sim/drv8871.h"

#include "real_math.h"

static const double DIODE_V = 0.8;        /* each body diode */
static const double SLEEP_AFTER_s = 1e-3; /* datasheet: 1 to 1.5 ms of both inputs low */
static const double WAKE_s = 45e-6;       /* datasheet: 40 to 50 us */
static const double FULLY_OPEN = 1.0 - 1e-9;

/* Share of the period in which two pulses, each rising at its phase, are both high. */
static hil_real_t overlap(hil_real_t in1, hil_real_t phase1, hil_real_t in2, hil_real_t phase2) {
    hil_real_t lag = phase2 - phase1;
    lag = hil_select(lag < 0.0, lag + 1.0, lag);
    const hil_real_t ahead = hil_min(in1 - lag, in2);          /* pulse 2 rises within pulse 1 */
    const hil_real_t around = hil_min(in1, in2 - (1.0 - lag)); /* pulse 2 reaches into the next pulse 1 */
    return hil_max(ahead, 0.0) + hil_max(around, 0.0);
}

void hil_drv8871_inputs(hil_drv8871_t *bridge, hil_real_t in1, hil_real_t phase1, hil_real_t in2, hil_real_t phase2,
                        double period_s) {
    const hil_real_t brake = overlap(in1, phase1, in2, phase2);
    bridge->drive = in1 - in2;
    bridge->coast = hil_max(1.0 - in1 - in2 + brake, 0.0);
    bridge->period_s = period_s;
    const hil_real_t asleep_s = bridge->coast * period_s;
    if (asleep_s > SLEEP_AFTER_s && !hil_drv8871_open(bridge)) {
        const hil_real_t lost = hil_min(WAKE_s / period_s, hil_abs(bridge->drive));
        bridge->drive -= hil_copysign(lost, bridge->drive);
        bridge->coast += lost;
    }
}

bool hil_drv8871_open(const hil_drv8871_t *bridge) {
    return bridge->coast >= FULLY_OPEN;
}

/* Share of the period in which the diodes conduct after the drive. `side`: sign of the drive. */
static hil_real_t diode_share(const hil_drv8871_t *bridge, const hil_winding_t *winding, hil_real_t supply_V,
                              hil_real_t side) {
    const hil_real_t tau_s = winding->inductance_H / winding->resistance_ohm;
    const hil_real_t emf_V = side * winding->back_emf_V;
    const hil_real_t on = hil_abs(bridge->drive) * bridge->period_s / tau_s;
    const hil_real_t peak_V = hil_max((supply_V - emf_V) * (1.0 - hil_exp(-on)), 0.0);
    const hil_real_t against_V = hil_max(supply_V + 2.0 * DIODE_V + emf_V, DIODE_V);
    return hil_min(tau_s * hil_log1p(peak_V / against_V) / bridge->period_s, bridge->coast);
}

hil_real_t hil_drv8871_mean_V(const hil_drv8871_t *bridge, const hil_winding_t *winding, hil_real_t supply_V) {
    const hil_real_t driven_V = bridge->drive * supply_V;
    if (bridge->coast <= 0.0) {
        return driven_V;
    }
    const hil_real_t side = hil_copysign(1.0, bridge->drive);
    const hil_real_t share = diode_share(bridge, winding, supply_V, side);
    return driven_V - side * share * (supply_V + 2.0 * DIODE_V) + (bridge->coast - share) * winding->back_emf_V;
}

hil_real_t hil_drv8871_freewheel(const hil_winding_t *winding, hil_real_t supply_V, hil_real_t time_s,
                                 hil_real_t *current_A) {
    const hil_real_t side = hil_copysign(1.0, *current_A);
    const hil_real_t start_A = hil_abs(*current_A);
    const hil_real_t against_V =
        supply_V + 2.0 * DIODE_V + side * winding->back_emf_V + winding->resistance_ohm * start_A;
    const hil_real_t slope = hil_max(against_V, DIODE_V) / winding->inductance_H;
    const hil_real_t end_A = hil_max(start_A - slope * time_s, 0.0);
    const hil_real_t dying_s = hil_min(start_A / slope, time_s);
    *current_A = side * end_A;
    return side * 0.5 * (start_A + end_A) * dying_s / time_s;
}
