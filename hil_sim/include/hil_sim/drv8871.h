/* SPDX-License-Identifier: MIT */
/**
 * @file drv8871.h
 * Mean behaviour of a DRV8871 H-bridge over one PWM period. Truth table (IN1 IN2): 00 coast, 10 forward, 01 reverse, 11
 * brake.
 *
 * While a side drives or brakes, the winding has +supply, -supply or 0, so the mean voltage is linear in the duties
 * (drive-brake). While both inputs are low the winding is open. Its current
 * decays through the body diodes into the supply; then the motor runs freely. So drive-coast is not linear: the mean
 * depends on when the current reaches zero within the period.
 */
#ifndef HIL_SIM_DRV8871_H
#define HIL_SIM_DRV8871_H

#include <stdbool.h>

#include "hil_sim/real.h"

/** Fractions of a PWM period. */
typedef struct hil_drv8871_t {
    hil_real_t drive; /**< forward minus reverse, -1..1 */
    hil_real_t coast; /**< both inputs low, 0..1 */
    double period_s;
} hil_drv8871_t;

/** The motor on a bridge. */
typedef struct hil_winding_t {
    hil_real_t resistance_ohm;
    hil_real_t inductance_H;
    hil_real_t back_emf_V;
} hil_winding_t;

/**
 * Set the inputs: duty cycle of each and phase of its rising edge, all 0..1. A bridge that coasts for more than 1 ms of
 * a period enters sleep mode; the wake-up time is then lost at the start of the next drive.
 */
void hil_drv8871_inputs(hil_drv8871_t *bridge, hil_real_t in1, hil_real_t phase1, hil_real_t in2, hil_real_t phase2,
                        double period_s);

/** Is the winding open for the whole period? */
bool hil_drv8871_open(const hil_drv8871_t *bridge);

/** Mean winding voltage [V] over a period in the steady state; an open winding has its back EMF. */
hil_real_t hil_drv8871_mean_V(const hil_drv8871_t *bridge, const hil_winding_t *winding, hil_real_t supply_V);

/**
 * Freewheeling: decay of the current of an open winding over `time_s`. @param current_A in and out. @return mean
 * current [A] over that time.
 */
hil_real_t hil_drv8871_freewheel(const hil_winding_t *winding, hil_real_t supply_V, hil_real_t time_s,
                                 hil_real_t *current_A);

#endif
