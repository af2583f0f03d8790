/* SPDX-License-Identifier: MIT */
#include "pose_control.h"

#include "math_inline.h"

void omni_pose_error(const omni_pose_t *pose, const omni_pose_t *reference, omni_real_t error[OMNI_AXES]) {
    error[0] = pose->x - reference->x;
    error[1] = pose->y - reference->y;
    error[2] = omni_wrap_pi(pose->theta - reference->theta);
}

omni_real_t omni_integrate(omni_real_t integral, omni_real_t increment, omni_real_t limit, bool hold) {
    const omni_real_t next = omni_clampf(integral + increment, -limit, limit);
    return hold && omni_absf(next) > omni_absf(integral) ? integral : next;
}
