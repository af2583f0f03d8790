/* SPDX-License-Identifier: MIT */
#include "omni/lqr.h"

#include <string.h>

#include "control/controllers.h"
#include "control/pose_control.h"
#include "model/kinematics_inline.h"

#define LQR_Z_MAX 0.1f

static void lqr_set_gains(omni_lqr_config_t *config, int axis, omni_real_t e, omni_real_t z, omni_real_t v) {
    config->k_i[axis] = v / z;
    config->k[axis] = omni_sqrtf((v / e) * (v / e) + 2.0f * config->k_i[axis]);
}

omni_result_t omni_configure_lqr(omni_robot_config_t *config, const omni_real_t *values, int32_t *bad_index) {
    omni_lqr_config_t *lqr = &config->lqr;
    *bad_index = -1;
    lqr->step_s = config->step_s * (omni_real_t)config->control_period;
    for (int axis = 0; axis < 2; ++axis) {
        lqr_set_gains(lqr, axis, values[OMNI_PARAM_LQR_E_XY], values[OMNI_PARAM_LQR_Z_XY], values[OMNI_PARAM_LQR_V_XY]);
    }
    lqr_set_gains(lqr, 2, values[OMNI_PARAM_LQR_E_TH], values[OMNI_PARAM_LQR_Z_TH], values[OMNI_PARAM_LQR_V_TH]);
    return OMNI_OK;
}

static void controller_reset_lqr(omni_control_state_t *control) {
    memset(&control->lqr, 0, sizeof control->lqr);
}

static omni_real_t lqr_rate(omni_lqr_state_t *state, const omni_lqr_config_t *config, int axis, omni_real_t rate,
                            omni_flag_t hold, omni_control_terms_t *terms) {
    const omni_real_t error = terms->error[axis];
    state->z[axis] = omni_integrate(state->z[axis], error * config->step_s, LQR_Z_MAX, hold);
    terms->equivalent[axis] = rate - config->k[axis] * error;
    terms->integral[axis] = state->z[axis];
    return terms->equivalent[axis] - config->k_i[axis] * state->z[axis];
}

static void controller_step_lqr(omni_control_state_t *control, const omni_robot_config_t *config,
                                const omni_estimate_t *estimate, const omni_reference_t *reference,
                                omni_flag_t saturated) {
    omni_control_terms_t *terms = &control->demand.terms;
    omni_twist_t world = {0.0f, 0.0f, 0.0f};
    memset(terms, 0, sizeof *terms);
    if (omni_pose_is_finite(&estimate->pose) && omni_pose_is_finite(&reference->pose) &&
        omni_twist_is_finite(&reference->rate)) {
        omni_pose_error(&estimate->pose, &reference->pose, terms->error);
        world.vx = lqr_rate(&control->lqr, &config->lqr, 0, reference->rate.vx, saturated, terms);
        world.vy = lqr_rate(&control->lqr, &config->lqr, 1, reference->rate.vy, saturated, terms);
        world.wz = lqr_rate(&control->lqr, &config->lqr, 2, reference->rate.wz, saturated, terms);
    }
    control->demand.twist = omni_rotate_to_body(&world, &estimate->heading);
}

const omni_controller_t omni_controller_row_lqr = {OMNI_DEMAND_TWIST, controller_reset_lqr, controller_step_lqr, NULL};
