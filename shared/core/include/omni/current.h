/* SPDX-License-Identifier: MIT */
/**
 * @file current.h
 * Sensorless motor current: estimate, current limit, and thermal model (I^2 t).
 *
 *   L i' = V - R i - K w         the winding [report eq. 25]; V: applied voltage, w: estimated speed
 *   h'   = ((i / I_c)^2 - h) / T thermal model: h = 1 is the steady state at the continuous current I_c
 *
 * The estimate needs no load torque, so it is valid for a blocked wheel, too. The wheel filter's is not: that filter
 * infers a low current from a wheel that does not turn, and its speed is wrong then. So the speed here is bounded by
 * the time without a count. It depends on MOT_K, MOT_R, the measured supply voltage, and a bridge that applies its
 * duty. Not modelled: a warm winding, a current-limiting bridge and PWM ripple. R includes the bridge and the wires.
 *
 * The limit acts on motors that drive or stall. It reduces their currents, and so their torques, by one factor, which
 * keeps the direction. A braking motor is not limited, so that no stop takes longer. Its current heats all the same.
 */
#ifndef OMNI_CURRENT_H
#define OMNI_CURRENT_H

#include "omni/types.h"

/** From the parameters LIM_I, SAFE_I, SAFE_I_TC and MOT_*. */
typedef struct omni_current_config_t {
    bool enabled;                      /**< LIM_I or SAFE_I is set: currents are estimated */
    bool limit_enabled;                /**< LIM_I is set */
    omni_real_t limit_V;               /**< R LIM_I: voltage that drives the current limit at standstill */
    omni_real_t brake_V;               /**< back-EMF from which a motor may count as braking */
    omni_real_t constant_V_s;          /**< K */
    omni_real_t conductance_S;         /**< 1 / R */
    omni_real_t current_decay;         /**< exp(-R T / L): factor of the current per tick */
    omni_real_t heat_gain;             /**< 1 - exp(-T / SAFE_I_TC): low-pass gain per tick */
    omni_real_t one_count_rad_s;       /**< speed of one count per tick */
    omni_real_t inverse_continuous_A2; /**< 1 / SAFE_I^2 [1/A^2]; 0: no thermal model */
} omni_current_config_t;

/** State per motor. */
typedef struct omni_current_state_t {
    omni_real_t current_A[OMNI_MAX_WHEELS];           /**< positive in the wheel's direction */
    omni_real_t wheel_rad_s[OMNI_MAX_WHEELS];         /**< w, bounded by the time without a count */
    omni_real_t ticks_without_count[OMNI_MAX_WHEELS]; /**< in a row, 1000 at most */
    omni_real_t heat[OMNI_MAX_WHEELS];                /**< h: 1 raises OMNI_FAULT_MOTOR_HEAT */
    bool overheated; /**< h has reached 1 and is not below OMNI_HEAT_WARNING_FRACTION yet */
} omni_current_state_t;

/** Heat h above which a warning is raised, and below which an overheated robot may be armed again. */
#define OMNI_HEAT_WARNING_FRACTION 0.8f

/**
 * Derive the configuration. All values within their parameters' ranges. @param limit_A, @param continuous_A 0: off.
 * @param heat_s thermal time constant. @param rad_per_count of an encoder. @param step_s tick period.
 */
void omni_current_configure(omni_current_config_t *config, omni_real_t limit_A, omni_real_t continuous_A,
                            omni_real_t heat_s, omni_real_t constant_V_s, omni_real_t resistance_ohm,
                            omni_real_t inductance_H, omni_real_t rad_per_count, omni_real_t step_s);

/**
 * Advance estimate and thermal model by `steps` ticks. Per motor: @param voltage_V applied voltage, @param wheel_rad_s
 * speed by the wheel filter, @param counts encoder increment. @param driven false: the bridges coast, no current.
 */
void omni_current_estimate(omni_current_state_t *state, const omni_current_config_t *config, uint8_t wheels,
                           const omni_real_t *voltage_V, const omni_real_t *wheel_rad_s, const omni_int_t *counts,
                           bool driven, uint32_t steps);

/**
 * Reduce the voltages so that no driving motor exceeds the current limit. With one factor f and back-EMF e = K w:
 * V' = e + f (V - e) for all motors that do not brake.
 * @param wheel_rad_s omni_current_state_t's. @param voltage_V in and out; |V'| <= max(|V|, brake_V).
 * @return f, 0..1; 1: not limited.
 */
omni_real_t omni_current_limit(const omni_current_config_t *config, uint8_t wheels, const omni_real_t *wheel_rad_s,
                               omni_real_t *voltage_V);

#endif
