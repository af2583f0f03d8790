/* SPDX-License-Identifier: MIT */
/**
 * @file motor_kf.h
 * Kalman filter of one wheel's motor: wheel speed and current from encoder counts and the voltage that was applied.
 *
 * With the motor of motor.h, discretised exactly (the report's eq. 45 takes A T + I):
 *
 *   x = A x + B V,   P = A P A^T + Q                        prediction [report eq. 52, 53]
 *   K = P C^T (C P C^T + R)^-1                              gain [report eq. 55, with the inverse it lacks]
 *   x = x + K (z - C x)                                     correction [report eq. 54]
 *   P = (I - K C) P (I - K C)^T + K R K^T                   Joseph form [in place of report eq. 56]
 *
 * Wheels are independent, so four such filters are the report's joint filter of eight states [report eq. 45-51].
 *
 * OMNI_KF_MODE_SPEED (the report's): state (w, i), measures the speed from differenced counts, C = [1 0].
 * OMNI_KF_MODE_ANGLE: state (angle, w, i), measures the encoder angle in counts, C = [1 0 0]. At 1 kHz one count per
 * tick is 0.6 rad/s, so quantisation dominates a differenced speed, but not the angle. The angle is kept relative to
 * the latest count, so that precision does not degrade over hours.
 * OMNI_KF_MODE_OFF: differenced counts, no filter.
 */
#ifndef OMNI_MOTOR_KF_H
#define OMNI_MOTOR_KF_H

#include "omni/motor.h"
#include "omni/params_gen.h"
#include "omni/types.h"

typedef struct omni_motor_kf_config_t {
    uint8_t mode;                /**< enum omni_kf_mode */
    omni_motor_discrete_t model; /**< discretised for step_s */
    omni_real_t step_s;          /**< tick period T */
    omni_real_t rad_per_count;   /**< 2 pi / counts per revolution */
    omni_real_t q_speed;         /**< variance added to w per step, (rad/s)^2 */
    omni_real_t q_current;       /**< variance added to i per step, A^2 */
    omni_real_t r_speed;         /**< variance of a differenced speed, (rad/s)^2 */
    omni_real_t r_angle;         /**< variance of a measured angle, rad^2 */
} omni_motor_kf_config_t;

typedef struct omni_motor_kf_state_t {
    omni_real_t x[3];                /**< angle beyond the latest count [rad], w [rad/s], i [A] */
    omni_real_t p[3][3];             /**< error covariance */
    omni_real_t innovation;          /**< of the last step, rad/s (SPEED) or rad (ANGLE) */
    omni_real_t innovation_variance; /**< its predicted variance */
    uint16_t missed;                 /**< ticks since the latest valid count */
} omni_motor_kf_state_t;

/** Reset to rest and no current, with standard deviations 1 rad/s and 1 A. */
void omni_motor_kf_reset(omni_motor_kf_state_t *state, const omni_motor_kf_config_t *config);

/**
 * Rebase the angle after the counter has jumped by an unknown amount: the new count is assigned the estimated angle.
 * Call it after the step with valid = false for the jump.
 */
void omni_motor_kf_rebase(omni_motor_kf_state_t *state);

/**
 * One tick: predict with the voltage applied since the last tick, correct with the counts moved since then (Joseph
 * form).
 * @param voltage_V  not finite counts as 0.
 * @param delta_counts  count increment since the last valid count.
 * @param valid  false: predict only (OFF: keep the last speed).
 * @return the wheel speed estimate [rad/s].
 */
omni_real_t omni_motor_kf_step(omni_motor_kf_state_t *state, const omni_motor_kf_config_t *config,
                               omni_real_t voltage_V, omni_int_t delta_counts, bool valid);

/**
 * One tick of mode SPEED with a directly measured speed; config->mode is ignored.
 * @param voltage_V  not finite counts as 0.
 * @param speed_rad_s  not finite: predict only.
 * @return the wheel speed estimate [rad/s].
 */
omni_real_t omni_motor_kf_step_speed(omni_motor_kf_state_t *state, const omni_motor_kf_config_t *config,
                                     omni_real_t voltage_V, omni_real_t speed_rad_s);

#endif
