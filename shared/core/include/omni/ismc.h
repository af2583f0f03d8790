/* SPDX-License-Identifier: MIT */
/**
 * @file ismc.h
 * Integral sliding mode controller of the pose. Why: it rejects wheel slip as long as the switching gain k exceeds the
 * error of the slip estimate.
 *
 * With e = xi - xi_d (heading error wrapped), per axis of the world frame:
 *
 *   s   = e + lambda * integral(e)                          [report eq. 39]
 *   u   = xi'_d - lambda e - k sw(s)                        world twist command [report eq. 41-43, before B / r]
 *
 * and sw is one of
 *
 *   sign            sw = sign(s)
 *   boundary layer  sw = clamp(s / phi, -1, 1)
 *   super-twisting  sw = sqrt|s / phi| sign(s) + w,   w' = k / (2 phi) sign(s),   |w| <= 1
 *
 * The slip v_s is compensated later, in the inverse kinematics: phi' = (B u + v_s) / r, omni_kinematics_inverse.
 * The error reaches zero if k >= eta + |B+ (v_s - v_s_hat)| per axis, with some eta > 0 [report eq. 44, corrected].
 * In print [report eq. 40] lacks the dot of xi'_d, and [report eq. 42] the factor 1 / r.
 */
#ifndef OMNI_ISMC_H
#define OMNI_ISMC_H

#include "omni/params_gen.h"
#include "omni/types.h"

typedef struct omni_ismc_config_t {
    omni_real_t lambda[OMNI_AXES];         /**< 1/s */
    omni_real_t k[OMNI_AXES];              /**< m/s, m/s, rad/s */
    omni_real_t phi[OMNI_AXES];            /**< boundary layer half width: m, m, rad; > 0 */
    omni_real_t integral_limit[OMNI_AXES]; /**< m s, m s, rad s */
    uint8_t switching;                     /**< enum omni_ismc_switch */
    omni_real_t step_s;
} omni_ismc_config_t;

typedef struct omni_ismc_state_t {
    omni_real_t integral[OMNI_AXES]; /**< integral of e */
    omni_real_t twisting[OMNI_AXES]; /**< super-twisting's w, dimensionless, -1..1 */
} omni_ismc_state_t;

/** Internal terms of a position controller, for telemetry; every entry per axis x, y, theta. */
typedef struct omni_control_terms_t {
    omni_real_t error[OMNI_AXES];
    omni_real_t integral[OMNI_AXES];
    omni_real_t surface[OMNI_AXES];    /**< s (ISMC), else 0 */
    omni_real_t equivalent[OMNI_AXES]; /**< continuous part of the world twist command (direct torque: acceleration) */
    omni_real_t
        switching[OMNI_AXES]; /**< switching (ISMC), integral + derivative (PID), derivative (direct torque) part */
} omni_control_terms_t;

void omni_ismc_reset(omni_ismc_state_t *state);

/**
 * One tick. @param hold_integral true while the wheels are saturated: the integral does not grow (anti-windup).
 * @return world twist command.
 */
omni_twist_t omni_ismc_step(omni_ismc_state_t *state, const omni_ismc_config_t *config, const omni_pose_t *pose,
                            const omni_pose_t *reference, const omni_twist_t *reference_rate, omni_flag_t hold_integral,
                            omni_control_terms_t *terms);

/**
 * Margin of the gain condition [report eq. 44] per axis: k - |B+ (v_s - v_s_hat)|; positive: the switching gain exceeds
 * the slip error.
 * @param b_pinv_slip_error world twist B+ (v_s - v_s_hat).
 */
void omni_ismc_gain_margin(const omni_ismc_config_t *config, const omni_twist_t *b_pinv_slip_error,
                           omni_real_t *margin);

#endif
