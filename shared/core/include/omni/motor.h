/* SPDX-License-Identifier: MIT */
/**
 * @file motor.h
 * Brushed DC motor with gear, all quantities referred to the wheel:
 *
 *   J w' + b w = K i                                        torque balance [report eq. 24]
 *   L i' + R i = V - K w                                    winding [report eq. 25]
 *
 * As a state equation, with the angle as a third state [report eq. 26, 27, without the angle]:
 *
 *   (angle, w, i)' = M (angle, w, i) + (0, 0, 1 / L) V,     M = [ 0  1  0;  0  -b/J  K/J;  0  -K/L  -R/L ]
 *
 * At rest V = (K + R b / K) w. Without the inductance an acceleration takes R J / K volts more per rad/s^2.
 */
#ifndef OMNI_MOTOR_H
#define OMNI_MOTOR_H

#include "omni/types.h"

typedef struct omni_motor_config_t {
    omni_real_t inertia_kg_m2;  /**< J > 0 */
    omni_real_t viscous_N_m_s;  /**< b >= 0 */
    omni_real_t constant_N_m_A; /**< K > 0, torque and back-EMF */
    omni_real_t resistance_ohm; /**< R > 0 */
    omni_real_t inductance_H;   /**< L > 0 */
} omni_motor_config_t;

/** Exact zero-order-hold discretisation over one step; state x = (angle [rad], w [rad/s], i [A]), input V. */
typedef struct omni_motor_discrete_t {
    omni_real_t a[3][3];
    omni_real_t b[3];
} omni_motor_discrete_t;

/**
 * Discretise by scaling and squaring of the matrix exponential. @param step_s (0, 1].
 * @return OMNI_ERR_NOT_FINITE, or OMNI_ERR_RANGE for constants outside their ranges or 1e12 times faster than the step;
 * `out` is then untouched.
 */
omni_result_t omni_motor_discretise(const omni_motor_config_t *motor, omni_real_t step_s, omni_motor_discrete_t *out);

/** Steady-state voltage per wheel speed [V s/rad]: K + R b / K. */
omni_real_t omni_motor_speed_gain(const omni_motor_config_t *motor);

/** Voltage per wheel acceleration [V s^2/rad]: R J / K (inductance neglected). */
omni_real_t omni_motor_acceleration_gain(const omni_motor_config_t *motor);

#endif
