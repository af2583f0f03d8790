/* SPDX-License-Identifier: MIT */
/**
 * @file direct_torque.h
 * Direct torque control of the pose: from the wanted acceleration to a torque per wheel, without wheel-speed loops.
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
 * A torque sets no speed: a wheel that loses its grip spins faster and faster. Two bounds guard against that. The grip,
 * if it is known, limits what the wheels ask of the floor. The function omni_direct_torque_protect fades out the torque
 * that drives a wheel away from the speed of the floor below it.
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
    omni_real_t wheel_inertia_kg_m2; /**< I_w >= 0, of one wheel with gear and motor, seen at the wheel */
    omni_real_t kp[OMNI_AXES];       /**< 1/s^2 */
    omni_real_t kd[OMNI_AXES];       /**< 1/s */
    omni_real_t torque_limit_N_m;    /**< tau_max per wheel [report eq. 30]; 0: none */
    omni_real_t grip;              /**< friction coefficient that may be used, all wheels equally loaded; 0: no bound */
    omni_real_t slip_limit_m_s;    /**< slip speed at which outward torque is gone, see protect; 0: not watched */
    omni_real_t wheel_limit_rad_s; /**< wheel speed at which outward torque is gone; 0: not watched */
    omni_real_t step_s;            /**< > 0: period of omni_direct_torque_protect */
} omni_direct_torque_config_t;

/**
 * Torques for the wanted motion. Acceleration is cut, direction kept, to what the floor takes (grip); torques likewise
 * to torque_limit [report eq. 30].
 * @param rate measured world twist. @param torque_N_m out, per wheel, at the wheel, beyond the motor's own friction.
 * @param terms out: `error` is xi - xi_d as everywhere, `equivalent` xi''_d + K_p e and `switching` K_d e', in m/s^2
 * and rad/s^2.
 * @return share of the wanted torque that the limits left, 0..1; 0 with all torques 0 if an input isn't finite.
 */
omni_real_t omni_direct_torque_step(const omni_direct_torque_config_t *config, const omni_kinematics_t *k,
                                    const omni_pose_t *pose, const omni_twist_t *rate,
                                    const omni_reference_t *reference, omni_real_t *torque_N_m,
                                    omni_control_terms_t *terms);

/**
 * Runaway protection, at least as often as wheel speeds are measured. Rim speed minus floor speed of wheel i is its
 * slip speed. Torque that raises it fades from full at half of slip_limit to none at slip_limit. Beyond, torque_limit
 * permitting, the wheel is braked at the rate that halves the excess per step. The wheel_limit works likewise over
 * its last tenth.
 * @param floor_body body twist of the robot over the floor as known without the wheels (a pose sensor). Wheel odometry
 * will not do: it follows the wheels. Without such knowledge give the reference's twist: the limit then bounds how fast
 *        an error may be worked off.
 * @param torque_N_m in and out.
 * @return smallest factor applied, 1: nothing cut, 0: a wheel was let go or braked.
 */
omni_real_t omni_direct_torque_protect(const omni_direct_torque_config_t *config, const omni_kinematics_t *k,
                                       const omni_twist_t *floor_body, const omni_real_t *wheel_rad_s,
                                       omni_real_t *torque_N_m);

#endif
