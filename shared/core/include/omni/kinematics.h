/* SPDX-License-Identifier: MIT */
/**
 * @file kinematics.h
 * Wheel speeds <-> body motion for three or four omni wheels at any bearing.
 *
 * For wheel i with radius r_i, distance l_i from the centre and bearing a_i, in the body frame:
 *
 *   r_i phi'_i - v_s,i = [ -sin a_i   cos a_i   l_i ] v_body       [report eq. 19, with our sign of phi']
 *   phi'   = (B v_body + v_s) / r,   row i of B as above           [report eq. 20, corrected]
 *   v_body = B+ (r phi' - v_s),      B+ = (B^T B)^-1 B^T           least squares [report eq. 22, corrected]
 *   v_body = R(theta) v_world,       R = [ cos sin 0; -sin cos 0; 0 0 1 ]          [report eq. 16]
 *
 * Four wheels leave one null direction n (n^T B = 0, |n| = 1): n^T r phi' = n^T v_s measures slip. Three leave none.
 * What differs from the report's eq. 15-23 is listed in docs/report/report-map.md.
 */
#ifndef OMNI_KINEMATICS_H
#define OMNI_KINEMATICS_H

#include "omni/types.h"

typedef struct omni_kinematics_config_t {
    uint8_t wheels;                          /**< 3 or 4 */
    omni_real_t radius_m[OMNI_MAX_WHEELS];   /**< effective rolling radius r_i, > 0 */
    omni_real_t distance_m[OMNI_MAX_WHEELS]; /**< centre to contact point l_i, > 0 */
    omni_real_t angle_rad[OMNI_MAX_WHEELS];  /**< bearing alpha_i, |alpha_i| <= 1e6 */
} omni_kinematics_config_t;

/** Constant matrices of one robot; read only after init. */
typedef struct omni_kinematics_t {
    uint8_t wheels;
    bool has_null; /**< four wheels: `null` is valid */
    omni_real_t radius_m[OMNI_MAX_WHEELS];
    omni_real_t b[OMNI_MAX_WHEELS][OMNI_AXES];      /**< B in the body frame, row per wheel */
    omni_real_t b_pinv[OMNI_AXES][OMNI_MAX_WHEELS]; /**< B+ */
    omni_real_t null[OMNI_MAX_WHEELS];              /**< unit null vector n of B^T, first component >= 0 */
} omni_kinematics_t;

/**
 * Compute the matrices. Unused wheel slots are zeroed.
 * @return OMNI_ERR_NOT_FINITE, OMNI_ERR_RANGE (wheel count, radius, distance, angle), OMNI_ERR_SINGULAR (wheels that
 *         cannot produce every motion, such as all at one bearing). The matrices are then all zero.
 */
omni_result_t omni_kinematics_init(omni_kinematics_t *k, const omni_kinematics_config_t *config);

/** Wheel speeds [rad/s] for a body twist; `slip_m_s` is the slip v_s per wheel to compensate, or NULL [report eq. 20].
 *  As many entries as there are wheels are read and written, here and below. */
void omni_kinematics_inverse(const omni_kinematics_t *k, const omni_twist_t *body, const omni_real_t *slip_m_s,
                             omni_real_t *wheel_rad_s);

/** Body twist from wheel speeds [rad/s], least squares; `slip_m_s` per wheel or NULL [report eq. 22]. Also maps
 *  wheel angle increments [rad] to body displacement. */
void omni_kinematics_forward(const omni_kinematics_t *k, const omni_real_t *wheel_rad_s, const omni_real_t *slip_m_s,
                             omni_twist_t *body);

/** n^T r phi' [m/s]: component of the rim speeds that is inconsistent with pure rolling. 0 for three wheels. */
omni_real_t omni_kinematics_slip_residual(const omni_kinematics_t *k, const omni_real_t *wheel_rad_s);

/** Mass and inertia of the body relative to the inertia J of one wheel with gear and motor. */
typedef struct omni_body_load_t {
    bool used;           /**< false: no body inertia is added */
    omni_real_t mass_m2; /**< m / J [1/m^2] */
    omni_real_t inertia; /**< I / J, about the centre */
} omni_body_load_t;

/**
 * Add the body's inertia to wheel accelerations: J times the result is the torque that accelerates wheel and body,
 * without friction.
 *
 *   phi''_i += r_i [ (B+)^T diag(m, m, I) a ]_i / J        least norm for four wheels
 *
 * Derived in docs/concepts/derivations/feed_forward.md. As many entries as there are wheels are read and written.
 * @param acceleration a [m/s^2, rad/s^2]: inertial acceleration in body axes, R xi''. Not the time derivative of the
 *        body twist, which lacks the term of the rotating frame.
 */
void omni_kinematics_add_body_inertia(const omni_kinematics_t *k, const omni_body_load_t *load,
                                      const omni_twist_t *acceleration, omni_real_t *wheel_rad_s2);

/** Sine and cosine of a heading, computed once to rotate several twists. */
typedef struct omni_rotation_t {
    omni_real_t sine;
    omni_real_t cosine;
} omni_rotation_t;

omni_rotation_t omni_rotation(omni_real_t theta);

/** World twist -> body twist by R(theta) [report eq. 16]. */
omni_twist_t omni_rotate_to_body(const omni_twist_t *world, const omni_rotation_t *r);

/** Body twist -> world twist by R(theta)^T. */
omni_twist_t omni_rotate_to_world(const omni_twist_t *body, const omni_rotation_t *r);

/** World twist -> body twist for heading theta [report eq. 16]. */
omni_twist_t omni_twist_to_body(const omni_twist_t *world, omni_real_t theta);

/** Body twist -> world twist for heading theta. */
omni_twist_t omni_twist_to_world(const omni_twist_t *body, omni_real_t theta);

#endif
