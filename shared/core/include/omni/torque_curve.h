/* SPDX-License-Identifier: MIT */
/**
 * @file torque_curve.h
 * Measured static characteristic of torque and PWM duty [report, text before eq. 30]: duty over torque / tau_max,
 * piecewise linear, odd-symmetric, from the deadband's edge to full duty. The deadband is crossed linearly within the
 * first hundredth of tau_max, so that a torque near zero does not chatter across it.
 */
#ifndef OMNI_TORQUE_CURVE_H
#define OMNI_TORQUE_CURVE_H

#include "omni/types.h"

enum { OMNI_CURVE_POINTS = 4 };

typedef struct omni_torque_curve_t {
    omni_real_t torque_max_N_m;          /**< at full duty, standing still, > 0 */
    omni_real_t deadband_duty;           /**< duty below which the motor gives no torque, 0..1 */
    omni_real_t duty[OMNI_CURVE_POINTS]; /**< at 20, 40, 60, 80 % of torque_max; rising, from deadband_duty to 1 */
} omni_torque_curve_t;

/** Does the curve rise strictly from deadband_duty to 1? (NaN: no.) @param bad_point out, may be NULL: first point that
 * does not lie above its predecessor, OMNI_CURVE_POINTS if the last is not below 1. */
bool omni_torque_curve_is_valid(const omni_torque_curve_t *curve, int32_t *bad_point);

/** Duty, -1..1, that gives a torque; beyond torque_max the full duty; NaN: 0. */
omni_real_t omni_torque_curve_duty(const omni_torque_curve_t *curve, omni_real_t torque_N_m);

/** Torque [N m] that a duty, -1..1 (clamped), gives; NaN: 0. Inverse of omni_torque_curve_duty. */
omni_real_t omni_torque_curve_torque(const omni_torque_curve_t *curve, omni_real_t duty);

#endif
