/* SPDX-License-Identifier: MIT */
/**
 * @file current.h
 * The motors' currents without a sensor: an estimate, a limit, and what the currents heat.
 *
 *   L i' = V - R i - K w         the winding [report eq. 25]; V: what the bridge was given, w: the estimated speed
 *   h'   = ((i / I_c)^2 - h) / T heat, as a share of what the continuous current I_c makes for ever (I^2 t)
 *
 * The estimate needs no torque, so it holds for a blocked wheel, too. (The wheel filter's current does not: that filter
 * takes a wheel that does not turn for one with little current. Its speed is off then, too. So a wheel without counts
 * turns by less than one in that time, whatever the filter says.) It trusts MOT_K, MOT_R,
 * the measured supply voltage, and that the bridge gives its duty. A warm winding, a
 * bridge that chops and the ripple of the PWM are not in it. R includes the bridge and the wires.
 *
 * The limit acts on motors that drive their wheels, and on those that stand. It takes the same share of all their
 * currents, and so of their pushes, which keeps the direction. A wheel that is braked keeps its whole current: no stop
 * gets longer. What brakes counts as heat all the same.
 */
#ifndef OMNI_CURRENT_H
#define OMNI_CURRENT_H

#include "omni/types.h"

/** From the parameters LIM_I, SAFE_I, SAFE_I_TC and MOT_*. */
typedef struct omni_current_config_t {
    bool watched;                /**< LIM_I or SAFE_I is set: currents are estimated */
    bool limited;                /**< LIM_I is set */
    omni_real_t limit_V;         /**< R LIM_I: what drives the largest current */
    omni_real_t brake_V;         /**< back-EMF from which a motor may count as braking */
    omni_real_t constant_V_s;    /**< K */
    omni_real_t per_ohm;         /**< 1 / R */
    omni_real_t keep;            /**< exp(-R T / L): what a tick leaves of a current */
    omni_real_t heat_step;       /**< 1 - exp(-T / SAFE_I_TC) */
    omni_real_t count_rad_s;     /**< a count per tick */
    omni_real_t per_continuous2; /**< 1 / SAFE_I^2; 0: not watched */
} omni_current_config_t;

/** What is kept of each motor. */
typedef struct omni_current_state_t {
    omni_real_t current_A[OMNI_MAX_WHEELS];   /**< in the wheel's direction */
    omni_real_t wheel_rad_s[OMNI_MAX_WHEELS]; /**< w, as far as counts have come */
    omni_real_t quiet[OMNI_MAX_WHEELS];       /**< ticks in a row without a count, 1000 at most */
    omni_real_t heat[OMNI_MAX_WHEELS];        /**< h: 1 stops the motors */
    omni_flag_t hot;                          /**< one has stopped them, and has not cooled to OMNI_WARM_SHARE yet */
} omni_current_state_t;

/** Heat from which a warning shows, and below which the robot may be armed again. */
#define OMNI_WARM_SHARE 0.8f

/**
 * The constants of a tick. All numbers in their parameters' ranges. @param limit_A, @param continuous_A 0: off.
 * @param heat_s time constant of the heat. @param rad_per_count of an encoder.
 */
void omni_current_configure(omni_current_config_t *config, omni_real_t limit_A, omni_real_t continuous_A,
                            omni_real_t heat_s, omni_real_t constant_V_s, omni_real_t resistance_ohm,
                            omni_real_t inductance_H, omni_real_t rad_per_count, omni_real_t step_s);

/**
 * `steps` ticks. @param voltage_V that each motor got, @param wheel_rad_s at which it turns now by the wheel filter,
 * @param counts by which its encoder moved. @param driven false: the bridges coast, so nothing flows.
 */
void omni_current_estimate(omni_current_state_t *state, const omni_current_config_t *config, uint8_t wheels,
                           const omni_real_t *voltage_V, const omni_real_t *wheel_rad_s, const omni_int_t *counts,
                           bool driven, uint32_t steps);

/**
 * Cut the voltages so that no motor which drives gets more than the limit. With one factor f and e = K w:
 * V' = e + f (V - e) for all motors but those that brake.
 * @param wheel_rad_s omni_current_state_t's. @param voltage_V in and out; |V'| <= max(|V|, brake_V).
 * @return f, 1: nothing cut.
 */
omni_real_t omni_current_limit(const omni_current_config_t *config, uint8_t wheels, const omni_real_t *wheel_rad_s,
                               omni_real_t *voltage_V);

#endif
