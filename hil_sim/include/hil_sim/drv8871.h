/* SPDX-License-Identifier: MIT */
/**
 * @file drv8871.h
 * Mean behaviour of a DRV8871 H-bridge over one PWM period. Truth table (IN1 IN2): 00 coast, 10 forward, 01 reverse, 11 brake.
 *
 * While a side drives or brakes, the winding sees +supply, -supply or 0, so the mean voltage is linear in the shares (drive-brake). While both
 * inputs are low the winding is open: its current returns through the body diodes into the supply until it is zero, then the
 * motor turns freely. Drive-coast is therefore not linear: the mean follows from when the current dies within the period.
 */
#ifndef HIL_SIM_DRV8871_H
#define HIL_SIM_DRV8871_H

#include <stdbool.h>

/** Shares of a PWM period. */
typedef struct hil_drv8871_t {
    double drive; /**< forward minus reverse, -1..1 */
    double coast; /**< both inputs low, 0..1 */
    double period_s;
} hil_drv8871_t;

/** The motor on a bridge. */
typedef struct hil_winding_t {
    double resistance_ohm;
    double inductance_H;
    double back_emf_V;
} hil_winding_t;

/**
 * Take over the inputs: share of the period each is high and phase of its rising edge, all 0..1. A bridge that coasts for more than 1 ms
 * of a period falls asleep and loses its waking time at the start of the next drive.
 */
void hil_drv8871_inputs(hil_drv8871_t *bridge, double in1, double phase1, double in2, double phase2, double period_s);

/** Is the winding open for the whole period? */
bool hil_drv8871_open(const hil_drv8871_t *bridge);

/** Mean winding voltage [V] over a period in the steady state; while the winding is open it counts as its back EMF. */
double hil_drv8871_mean_V(const hil_drv8871_t *bridge, const hil_winding_t *winding, double supply_V);

/**
 * Let the current of an open winding die for `time_s`. @param current_A in and out. @return mean current [A] over that time.
 */
double hil_drv8871_freewheel(const hil_winding_t *winding, double supply_V, double time_s, double *current_A);

#endif
