/* SPDX-License-Identifier: MIT */
/** @file pose_control.h  Common functions of the position controllers. Not part of the API. */
#ifndef OMNI_POSE_CONTROL_H
#define OMNI_POSE_CONTROL_H

#include "../math/math_inline.h"

/** error = pose - reference, heading wrapped into [-pi, pi): m, m, rad. */
static inline void omni_pose_error(const omni_pose_t *pose, const omni_pose_t *reference,
                                   omni_real_t error[OMNI_AXES]) {
    error[0] = pose->x - reference->x;
    error[1] = pose->y - reference->y;
    error[2] = omni_wrap_pi(pose->theta - reference->theta);
}

/**
 * integral + increment, limited to [-limit, limit]. @param hold true: it may shrink but not grow.
 */
static inline omni_real_t omni_integrate(omni_real_t integral, omni_real_t increment, omni_real_t limit,
                                         omni_flag_t hold) {
    const omni_real_t next = omni_clampf(integral + increment, -limit, limit);
    return omni_select(hold && omni_absf(next) > omni_absf(integral), integral, next);
}

#endif
