/* SPDX-License-Identifier: MIT */
#include "hil_sim/drv8871.h"

#include <math.h>

static const double DIODE_V = 0.8;        /* each body diode */
static const double SLEEP_AFTER_s = 1e-3; /* datasheet: 1 to 1.5 ms of both inputs low */
static const double WAKE_s = 45e-6;       /* datasheet: 40 to 50 us */
static const double FULLY_OPEN = 1.0 - 1e-9;

/* Share of the period in which two pulses, each rising at its phase, are both high. */
static double overlap(double in1, double phase1, double in2, double phase2) {
    double lag = phase2 - phase1;
    lag -= floor(lag);
    const double ahead = fmin(in1 - lag, in2);          /* pulse 2 rises within pulse 1 */
    const double around = fmin(in1, in2 - (1.0 - lag)); /* pulse 2 reaches into the next pulse 1 */
    return fmax(ahead, 0.0) + fmax(around, 0.0);
}

void hil_drv8871_inputs(hil_drv8871_t *bridge, double in1, double phase1, double in2, double phase2, double period_s) {
    const double brake = overlap(in1, phase1, in2, phase2);
    bridge->drive = in1 - in2;
    bridge->coast = fmax(1.0 - in1 - in2 + brake, 0.0);
    bridge->period_s = period_s;
    const double asleep_s = bridge->coast * period_s;
    if (asleep_s > SLEEP_AFTER_s && !hil_drv8871_open(bridge)) {
        const double lost = fmin(WAKE_s / period_s, fabs(bridge->drive));
        bridge->drive -= copysign(lost, bridge->drive);
        bridge->coast += lost;
    }
}

bool hil_drv8871_open(const hil_drv8871_t *bridge) {
    return bridge->coast >= FULLY_OPEN;
}

/* Share of the period in which the diodes conduct after the drive. `side`: sign of the drive. */
static double diode_share(const hil_drv8871_t *bridge, const hil_winding_t *winding, double supply_V, double side) {
    const double tau_s = winding->inductance_H / winding->resistance_ohm;
    const double emf_V = side * winding->back_emf_V;
    const double on = fabs(bridge->drive) * bridge->period_s / tau_s;
    const double peak_V = fmax((supply_V - emf_V) * (1.0 - exp(-on)), 0.0);
    const double against_V = fmax(supply_V + 2.0 * DIODE_V + emf_V, DIODE_V);
    return fmin(tau_s * log1p(peak_V / against_V) / bridge->period_s, bridge->coast);
}

double hil_drv8871_mean_V(const hil_drv8871_t *bridge, const hil_winding_t *winding, double supply_V) {
    const double driven_V = bridge->drive * supply_V;
    if (bridge->coast <= 0.0) {
        return driven_V;
    }
    const double side = copysign(1.0, bridge->drive);
    const double share = diode_share(bridge, winding, supply_V, side);
    return driven_V - side * share * (supply_V + 2.0 * DIODE_V) + (bridge->coast - share) * winding->back_emf_V;
}

double hil_drv8871_freewheel(const hil_winding_t *winding, double supply_V, double time_s, double *current_A) {
    const double side = copysign(1.0, *current_A);
    const double start_A = fabs(*current_A);
    const double against_V = supply_V + 2.0 * DIODE_V + side * winding->back_emf_V + winding->resistance_ohm * start_A;
    const double slope = fmax(against_V, DIODE_V) / winding->inductance_H;
    const double end_A = fmax(start_A - slope * time_s, 0.0);
    const double dying_s = fmin(start_A / slope, time_s);
    *current_A = side * end_A;
    return side * 0.5 * (start_A + end_A) * dying_s / time_s;
}
