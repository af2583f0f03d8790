/* SPDX-License-Identifier: MIT */
#include "omni/feedback_linearization.h"

#include <string.h>

#include "pose_control.h"

void omni_fl_reset(omni_fl_state_t *state) {
    memset(state, 0, sizeof *state);
}

static omni_real_t fl_step_axis(omni_fl_state_t *state, const omni_fl_config_t *config, int axis, omni_real_t rate,
                                omni_real_t reference_rate, omni_flag_t hold, omni_control_terms_t *terms) {
    const omni_real_t error = terms->error[axis];
    terms->integral[axis] = state->integral[axis];
    /* [report eq. 34] */
    terms->equivalent[axis] = reference_rate - config->kp[axis] * error;
    /* [report eq. 36, 38]: with a limited integral */
    terms->switching[axis] = -config->kd[axis] * (rate - reference_rate) - config->ki[axis] * state->integral[axis];
    state->integral[axis] =
        omni_integrate(state->integral[axis], error * config->step_s, config->integral_limit[axis], hold);
    return terms->equivalent[axis] + terms->switching[axis];
}

omni_twist_t omni_fl_step(omni_fl_state_t *state, const omni_fl_config_t *config, const omni_pose_t *pose,
                          const omni_twist_t *rate, const omni_pose_t *reference, const omni_twist_t *reference_rate,
                          omni_flag_t hold_integral, omni_control_terms_t *terms) {
    omni_twist_t wanted = {0.0f, 0.0f, 0.0f};
    memset(terms, 0, sizeof *terms);
    if (!omni_motion_is_finite(pose, rate) || !omni_motion_is_finite(reference, reference_rate)) {
        return wanted;
    }
    omni_pose_error(pose, reference, terms->error);
    wanted.vx = fl_step_axis(state, config, 0, rate->vx, reference_rate->vx, hold_integral, terms);
    wanted.vy = fl_step_axis(state, config, 1, rate->vy, reference_rate->vy, hold_integral, terms);
    wanted.wz = fl_step_axis(state, config, 2, rate->wz, reference_rate->wz, hold_integral, terms);
    return wanted;
}
