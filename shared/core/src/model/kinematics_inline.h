/* SPDX-License-Identifier: MIT */
/**
 * @file kinematics_inline.h
 * Inline bodies of the functions of omni/kinematics.h that the tick uses: see math_inline.h. kinematics.c provides the
 * external definitions. Not part of the API.
 */
#ifndef OMNI_KINEMATICS_INLINE_H
#define OMNI_KINEMATICS_INLINE_H

#include "../math/math_inline.h"
#include "omni/kinematics.h"

#ifndef OMNI_KINEMATICS_INLINE
#define OMNI_KINEMATICS_INLINE OMNI_INLINE
#endif

/** l of the first wheel [m]: converts a turn to the distance of a wheel. 0 for a configuration that failed. */
static inline omni_real_t omni_lever_arm_m(const omni_kinematics_t *k) {
    return k->b[0][2];
}

OMNI_KINEMATICS_INLINE void omni_kinematics_inverse(const omni_kinematics_t *k, const omni_twist_t *body,
                                                    const omni_real_t *slip_m_s, omni_real_t *wheel_rad_s) {
    for (int i = 0; i < k->wheels; i++) {
        /* [report eq. 20], corrected: phi' = (B v + v_s) / r */
        const omni_real_t rolling = k->b[i][0] * body->vx + k->b[i][1] * body->vy + k->b[i][2] * body->wz;
        const omni_real_t slip = slip_m_s != NULL ? slip_m_s[i] : 0.0f;
        wheel_rad_s[i] = (rolling + slip) / k->radius_m[i];
    }
}

OMNI_KINEMATICS_INLINE void omni_kinematics_forward(const omni_kinematics_t *k, const omni_real_t *wheel_rad_s,
                                                    const omni_real_t *slip_m_s, omni_twist_t *body) {
    omni_twist_t sum = {0.0f, 0.0f, 0.0f};
    for (int i = 0; i < k->wheels; i++) {
        /* [report eq. 22], corrected: v = B+ (r phi' - v_s) */
        const omni_real_t slip = slip_m_s != NULL ? slip_m_s[i] : 0.0f;
        const omni_real_t rolled = k->radius_m[i] * wheel_rad_s[i] - slip;
        sum.vx += k->b_pinv[0][i] * rolled;
        sum.vy += k->b_pinv[1][i] * rolled;
        sum.wz += k->b_pinv[2][i] * rolled;
    }
    *body = sum;
}

OMNI_KINEMATICS_INLINE void omni_kinematics_add_body_inertia(const omni_kinematics_t *k, const omni_body_load_t *load,
                                                             const omni_twist_t *acceleration,
                                                             omni_real_t *wheel_rad_s2) {
    const omni_twist_t push = {load->mass_m2 * acceleration->vx, load->mass_m2 * acceleration->vy,
                               load->inertia * acceleration->wz};
    for (int i = 0; i < k->wheels; i++) {
        const omni_real_t force = k->b_pinv[0][i] * push.vx + k->b_pinv[1][i] * push.vy + k->b_pinv[2][i] * push.wz;
        wheel_rad_s2[i] += k->radius_m[i] * force;
    }
}

OMNI_KINEMATICS_INLINE omni_rotation_t omni_rotation(omni_real_t theta) {
    omni_rotation_t r;
    omni_sincosf(theta, &r.sine, &r.cosine);
    return r;
}

OMNI_KINEMATICS_INLINE omni_twist_t omni_rotate_to_body(const omni_twist_t *world, const omni_rotation_t *r) {
    /* [report eq. 16]: R(theta) */
    const omni_twist_t body = {r->cosine * world->vx + r->sine * world->vy,
                               -r->sine * world->vx + r->cosine * world->vy, world->wz};
    return body;
}

OMNI_KINEMATICS_INLINE omni_twist_t omni_rotate_to_world(const omni_twist_t *body, const omni_rotation_t *r) {
    /* [report eq. 16]: R(theta)^T */
    const omni_twist_t world = {r->cosine * body->vx - r->sine * body->vy, r->sine * body->vx + r->cosine * body->vy,
                                body->wz};
    return world;
}

#endif
