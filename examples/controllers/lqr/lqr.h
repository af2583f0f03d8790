/* SPDX-License-Identifier: MIT */
/**
 * @file lqr.h
 * A linear-quadratic regulator of the pose with integral action: gains from the deviations that one accepts.
 *
 * The wheel loops are fast, so per axis of the world frame the pose error e follows the correction v of the wanted
 * rate: e' = v, z' = e. The regulator minimises the integral of (e / E)^2 + (z / Z)^2 + (v / V)^2, in which E, Z and V
 * are the deviations that weigh alike (Bryson's rule). The solution of its Riccati equation has the closed form
 *
 *   k_i = V / Z      k = sqrt((V / E)^2 + 2 k_i)
 *   u = reference rate - k e - k_i z                         wanted world twist
 *
 * It assumes that the wheels roll without slip; z takes what remains.
 */
#ifndef OMNI_LQR_H
#define OMNI_LQR_H

#include "omni/types.h"

typedef struct omni_lqr_config_t {
    omni_real_t step_s;         /**< > 0 */
    omni_real_t k[OMNI_AXES];   /**< 1/s */
    omni_real_t k_i[OMNI_AXES]; /**< 1/s^2 */
} omni_lqr_config_t;

typedef struct omni_lqr_state_t {
    omni_real_t z[OMNI_AXES]; /**< m s, m s, rad s; within -0.1..0.1 */
} omni_lqr_state_t;

#endif
