/* SPDX-License-Identifier: MIT */
#include "omni/ismc.h"

#include <string.h>

#include "pose_control.h"

void omni_ismc_reset(omni_ismc_state_t *state) {
    memset(state, 0, sizeof *state);
}

/* sw(s); super-twisting also advances its own integral w. */
static omni_real_t ismc_switching(const omni_ismc_config_t *config, int axis, omni_real_t surface,
                                  omni_real_t *twisting, omni_flag_t hold) {
    if (config->switching == OMNI_ISMC_SWITCH_SIGN) {
        return omni_signf(surface);
    }
    const omni_real_t ratio = surface / config->phi[axis];
    if (config->switching == OMNI_ISMC_SWITCH_BOUNDARY) {
        return omni_clampf(ratio, -1.0f, 1.0f);
    }
    const omni_real_t sign = omni_signf(surface);
    const omni_real_t value = omni_sqrtf(omni_absf(ratio)) * sign + *twisting;
    const omni_real_t rate = 0.5f * config->k[axis] / config->phi[axis] * sign;
    *twisting = omni_integrate(*twisting, rate * config->step_s, 1.0f, hold);
    return value;
}

/* The surface takes the integral of the errors before this one: with forward differences s then changes by -k sw T
 * exactly. */
static omni_real_t ismc_step_axis(omni_ismc_state_t *state, const omni_ismc_config_t *config, int axis,
                                  omni_real_t rate, omni_flag_t hold, omni_control_terms_t *terms) {
    const omni_real_t error = terms->error[axis];
    terms->integral[axis] = state->integral[axis];
    /* [report eq. 39] */
    terms->surface[axis] = error + config->lambda[axis] * state->integral[axis];
    /* [report eq. 41], with the derivative that [report eq. 40] misses */
    terms->equivalent[axis] = rate - config->lambda[axis] * error;
    /* [report eq. 42] */
    terms->switching[axis] =
        -config->k[axis] * ismc_switching(config, axis, terms->surface[axis], &state->twisting[axis], hold);
    state->integral[axis] =
        omni_integrate(state->integral[axis], error * config->step_s, config->integral_limit[axis], hold);
    /* [report eq. 43] */
    return terms->equivalent[axis] + terms->switching[axis];
}

omni_twist_t omni_ismc_step(omni_ismc_state_t *state, const omni_ismc_config_t *config, const omni_pose_t *pose,
                            const omni_pose_t *reference, const omni_twist_t *reference_rate, omni_flag_t hold_integral,
                            omni_control_terms_t *terms) {
    omni_twist_t wanted = {0.0f, 0.0f, 0.0f};
    if (!omni_pose_is_finite(pose) || !omni_motion_is_finite(reference, reference_rate)) {
        memset(terms, 0, sizeof *terms);
        return wanted;
    }
    omni_pose_error(pose, reference, terms->error);
    wanted.vx = ismc_step_axis(state, config, 0, reference_rate->vx, hold_integral, terms);
    wanted.vy = ismc_step_axis(state, config, 1, reference_rate->vy, hold_integral, terms);
    wanted.wz = ismc_step_axis(state, config, 2, reference_rate->wz, hold_integral, terms);
    return wanted;
}

void omni_ismc_gain_margin(const omni_ismc_config_t *config, const omni_twist_t *b_pinv_slip_error,
                           omni_real_t *margin) {
    /* [report eq. 44], corrected: k >= eta + |B+ (v_s - v_s_hat)| */
    margin[0] = config->k[0] - omni_absf(b_pinv_slip_error->vx);
    margin[1] = config->k[1] - omni_absf(b_pinv_slip_error->vy);
    margin[2] = config->k[2] - omni_absf(b_pinv_slip_error->wz);
}
