/* SPDX-License-Identifier: MIT */
/**
 * @file feedback_linearization.h
 * P, PD and PID control of the pose after feedback linearisation. Assumes wheels that roll without slip.
 *
 * With e = xi - xi_d (heading error wrapped), per axis of the world frame:
 *
 *   u = xi'_d - K_p e - K_d e' - K_i integral(e)            world twist command [report eq. 33-38]
 *
 * P: K_d = K_i = 0; PD: K_i = 0. The integral is limited; the report's eq. 38 has no limit. Gains
 * are rates: K_p here is the report's K_p divided by its time step T.
 */
#ifndef OMNI_FEEDBACK_LINEARIZATION_H
#define OMNI_FEEDBACK_LINEARIZATION_H

#include "omni/ismc.h"
#include "omni/types.h"

typedef struct omni_fl_config_t {
    omni_real_t kp[OMNI_AXES];             /**< 1/s */
    omni_real_t kd[OMNI_AXES];             /**< dimensionless; 0 for P */
    omni_real_t ki[OMNI_AXES];             /**< 1/s^2; 0 for P and PD */
    omni_real_t integral_limit[OMNI_AXES]; /**< m s, m s, rad s */
    omni_real_t step_s;
} omni_fl_config_t;

typedef struct omni_fl_state_t {
    omni_real_t integral[OMNI_AXES];
} omni_fl_state_t;

void omni_fl_reset(omni_fl_state_t *state);

/** One tick. @param rate measured world twist (for e'). @param hold_integral as in omni_ismc_step. */
omni_twist_t omni_fl_step(omni_fl_state_t *state, const omni_fl_config_t *config, const omni_pose_t *pose,
                          const omni_twist_t *rate, const omni_pose_t *reference, const omni_twist_t *reference_rate,
                          omni_flag_t hold_integral, omni_control_terms_t *terms);

#endif
