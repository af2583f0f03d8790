/* SPDX-License-Identifier: MIT */
/**
 * @file wheel_speed.h
 * Wheel speed loops of all wheels: feed-forward from the motor model and PID, then voltages to duty with the direction
 * kept.
 *
 *   V    = (K + R b / K) w_d + (R J / K) w_d' + V_c clamp(w_d / 0.05, -1, 1) + PID(w_d, w)
 *   duty = V / supply, all wheels scaled by one factor to the limit                [report eq. 30]
 *
 * The first two terms are the motor's equations solved for the voltage [report eq. 24, 25, without L]. V_c compensates
 * Coulomb friction. J is the inertia of the wheel with gear and motor; the caller adds the body's inertia to w_d'
 * (omni_kinematics_add_body_inertia).
 */
#ifndef OMNI_WHEEL_SPEED_H
#define OMNI_WHEEL_SPEED_H

#include "omni/pid.h"
#include "omni/types.h"

typedef struct omni_wheel_speed_config_t {
    uint8_t wheels;
    omni_pid_config_t pid;            /**< output in V */
    omni_real_t ff_speed_V_s;         /**< V per rad/s */
    omni_real_t ff_acceleration_V_s2; /**< V per rad/s^2 */
    omni_real_t ff_static_V; /**< V_c: Coulomb friction, in the direction of the reference; fades below 0.05 rad/s */
    omni_real_t duty_limit;  /**< 0..1 */
    omni_real_t
        null_direction[OMNI_MAX_WHEELS]; /**< u: unit vector of voltages that do not move the body; 0: 3 wheels */
} omni_wheel_speed_config_t;

typedef struct omni_wheel_speed_state_t {
    omni_pid_state_t pid[OMNI_MAX_WHEELS];
} omni_wheel_speed_state_t;

void omni_wheel_speed_reset(omni_wheel_speed_state_t *state);

/**
 * One tick. All arrays have OMNI_MAX_WHEELS entries.
 * @param reference [rad/s], @param acceleration [rad/s^2] of the reference, with or without body inertia, @param
 * measured [rad/s], @param supply_V > 0.
 * @param duty out, -limit..limit; @param voltage_V out, duty * supply_V.
 * @return the common factor by which the voltages were cut (1: none). It is 0 with all duties 0 if supply or limit are
 *         0 or less or anything isn't finite. The loops' states are unchanged then.
 */
omni_real_t omni_wheel_speed_step(omni_wheel_speed_state_t *state, const omni_wheel_speed_config_t *config,
                                  const omni_real_t *reference, const omni_real_t *acceleration,
                                  const omni_real_t *measured, omni_real_t supply_V, omni_real_t *duty,
                                  omni_real_t *voltage_V);

/**
 * Project the null direction out of the integrals: I -= u (u I). Four wheels are redundant: with a radius error or
 * creep their speeds cannot all reach the references, and without this the integrals would wind up until the wheels
 * slip. The result stays within integral_limit. No effect with three wheels.
 */
void omni_wheel_speed_balance(omni_wheel_speed_state_t *state, const omni_wheel_speed_config_t *config);

#endif
