/* SPDX-License-Identifier: MIT */
/**
 * @file direct_torque.h
 * Direct torque control of the pose: from the desired acceleration to a torque per wheel, without wheel-speed loops.
 * Derived in docs/concepts/derivations/direct_torque.md.
 *
 * With e = xi_d - xi (heading wrapped):
 *
 *   u   = K_d e' + K_p e                                    [report eq. 29, with other signs]
 *   tau = r (B+)^T R [ M* (xi''_d + u) + N* xi' ]           [report eq. 28, corrected]; least norm for four wheels
 *   M*  = M + R^T B^T D B R,   N* = R^T B^T D B R'
 *   M   = diag(m, m, I),       D = diag(I_w / r_i^2)
 *
 * If a torque exceeds tau_max, all are scaled by one factor, so that their direction stays [report eq. 30]. The report
 * prints tau = M* (q''_d - u) with u = -K_d e' - K_p e and negative gains [report eq. 28-32]. In the signs used here
 * these are kp = -5 and kd = -4.1, which has a root at +5.08 1/s. Gains of either sign are accepted.
 *
 * A torque command does not bound the speed: a wheel that loses traction runs away. Two limits prevent that: the
 * friction coefficient, if known, limits the force per wheel, and omni_direct_torque_protect fades out torque that
 * increases the slip speed of a wheel.
 */
#ifndef OMNI_DIRECT_TORQUE_H
#define OMNI_DIRECT_TORQUE_H

#include "omni/ismc.h"
#include "omni/kinematics.h"
#include "omni/trajectory.h"
#include "omni/types.h"

typedef struct omni_direct_torque_config_t {
    omni_real_t mass_kg;             /**< m > 0 */
    omni_real_t inertia_kg_m2;       /**< I > 0, of the robot about its centre */
    omni_real_t wheel_inertia_kg_m2; /**< I_w >= 0, of one wheel with gear and motor, referred to the wheel */
    omni_real_t kp[OMNI_AXES];       /**< 1/s^2 */
    omni_real_t kd[OMNI_AXES];       /**< 1/s */
    omni_real_t torque_limit_N_m;    /**< tau_max per wheel [report eq. 30]; 0: none */
    omni_real_t grip;                /**< friction coefficient, for equally loaded wheels; 0: no limit */
    omni_real_t slip_limit_m_s;      /**< slip speed at which outward torque reaches 0, see protect; 0: no limit */
    omni_real_t wheel_limit_rad_s;   /**< wheel speed at which outward torque reaches 0; 0: no limit */
    omni_real_t step_s;              /**< > 0: period of omni_direct_torque_protect */
} omni_direct_torque_config_t;

/**
 * Torques for the desired acceleration. Acceleration is limited by the friction coefficient and torques by
 * torque_limit, each by one factor that keeps the direction [report eq. 30].
 * @param rate measured world twist. @param torque_N_m out, per wheel, at the wheel, motor friction not included.
 * @param terms out: `error` is xi - xi_d as everywhere, `equivalent` xi''_d + K_p e and `switching` K_d e', in m/s^2
 * and rad/s^2.
 * @return factor by which the limits reduced the torques, 0..1; 0 with all torques 0 if an input isn't finite.
 */
omni_real_t omni_direct_torque_step(const omni_direct_torque_config_t *config, const omni_kinematics_t *k,
                                    const omni_pose_t *pose, const omni_twist_t *rate,
                                    const omni_reference_t *reference, omni_real_t *torque_N_m,
                                    omni_control_terms_t *terms);

/**
 * Runaway protection; call it at least at the rate of the wheel-speed measurement. Slip speed of wheel i: rim speed
 * minus floor speed. Torque that increases it fades linearly from full at half of slip_limit to 0 at slip_limit.
 * Beyond, the wheel is braked with the torque that halves the excess per step, up to torque_limit. wheel_limit works
 * likewise over its last tenth.
 * @param floor_body body twist from a source independent of the wheels, such as pose fixes; wheel odometry follows
 *        spinning wheels. Without one use the reference's twist: the limit then bounds the rate of error correction.
 * @param torque_N_m in and out.
 * @return smallest factor applied; 1: not limited, 0: a wheel's torque was removed or reversed to brake.
 */
omni_real_t omni_direct_torque_protect(const omni_direct_torque_config_t *config, const omni_kinematics_t *k,
                                       const omni_twist_t *floor_body, const omni_real_t *wheel_rad_s,
                                       omni_real_t *torque_N_m);

#endif
