/* SPDX-License-Identifier: MIT */
/** @file pose_control.h  What the position controllers share. Not part of the API. */
#ifndef OMNI_POSE_CONTROL_H
#define OMNI_POSE_CONTROL_H

#include "omni/types.h"

/** error = pose - reference, heading wrapped into [-pi, pi): m, m, rad. */
void omni_pose_error(const omni_pose_t *pose, const omni_pose_t *reference, omni_real_t error[OMNI_AXES]);

/**
 * integral + increment, limited to [-limit, limit]. @param hold true: it may shrink but not grow.
 */
omni_real_t omni_integrate(omni_real_t integral, omni_real_t increment, omni_real_t limit, bool hold);

#endif
