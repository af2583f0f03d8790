/* SPDX-License-Identifier: MIT */
#include <stddef.h>
#include <string.h>

#include "../estimate/pose_ekf_inline.h"
#include "../model/kinematics_inline.h"
#include "controllers.h"

/* Bound on the slip error in standard deviations. */
static const omni_real_t sigmas = 3.0f;

/* Debounce time of the warning, both ways. */
static const omni_real_t debounce_s = 0.5f;

/* Update period: slip and speed change far more slowly. */
enum { margin_period_ticks = 8 };

/* d(world twist) / d(slip ratios): rows of R^T B+ diag(r phi'). */
static inline void slip_sensitivity(const omni_kinematics_t *k, const omni_estimate_t *estimate,
                                    omni_real_t rows[OMNI_AXES][OMNI_MAX_WHEELS], uint8_t wheels) {
    for (uint8_t i = 0; i < wheels; ++i) {
        const omni_real_t rim_m_s = k->radius_m[i] * estimate->wheel_rad_s[i];
        const omni_twist_t body = {k->b_pinv[0][i] * rim_m_s, k->b_pinv[1][i] * rim_m_s, k->b_pinv[2][i] * rim_m_s};
        const omni_twist_t world = omni_rotate_to_world(&body, &estimate->heading);
        rows[0][i] = world.vx;
        rows[1][i] = world.vy;
        rows[2][i] = world.wz;
    }
}

/* Bound of |B+ (v_s - v_s_hat)| on one axis: uncompensated part of the estimate, and its uncertainty. */
static inline omni_real_t slip_bound(const omni_pose_ekf_config_t *config, const omni_pose_ekf_state_t *ekf,
                                     const omni_real_t *ratio, const omni_real_t *row, omni_real_t fed,
                                     uint8_t wheels) {
    const bool estimated = config->mode == OMNI_EKF_MODE_SLIP;
    omni_real_t left = 0.0f;
    omni_real_t variance = 0.0f;
    for (uint8_t i = 0; i < wheels; ++i) {
        if (estimated) {
            left += row[i] * (1.0f - fed) * ratio[i];
        } else {
            variance += row[i] * row[i] * config->p_slip;
        }
    }
    if (estimated) {
        variance = omni_pose_ekf_slip_variance(ekf, row, wheels);
    }
    return omni_absf(left) + sigmas * omni_sqrtf(variance);
}

static inline omni_twist_t slip_bounds(const omni_robot_config_t *config, const omni_pose_ekf_state_t *ekf,
                                       const omni_estimate_t *estimate, omni_real_t fed, uint8_t wheels) {
    const omni_pose_ekf_config_t *c = &config->pose_ekf;
    const omni_real_t *ratio = estimate->slip_ratio;
    omni_real_t rows[OMNI_AXES][OMNI_MAX_WHEELS];
    slip_sensitivity(&config->kinematics, estimate, rows, wheels);
    return (omni_twist_t){slip_bound(c, ekf, ratio, rows[0], fed, wheels),
                          slip_bound(c, ekf, ratio, rows[1], fed, wheels),
                          slip_bound(c, ekf, ratio, rows[2], fed, wheels)};
}

static omni_flag_t margin_is_positive(const omni_real_t margin[OMNI_AXES]) {
    return margin[0] >= 0.0f && margin[1] >= 0.0f && margin[2] >= 0.0f;
}

static void update_gain_margin(omni_gain_margin_t *state, const omni_robot_config_t *config,
                               const omni_pose_ekf_state_t *ekf, const omni_estimate_t *estimate) {
    const omni_real_t fed = estimate->fix_is_fresh ? config->slip_feedforward : 0.0f;
    /* The count as a constant lets the compiler unroll the loops. */
    const omni_twist_t bound = config->kinematics.wheels == 3
                                   ? slip_bounds(config, ekf, estimate, fed, 3)
                                   : slip_bounds(config, ekf, estimate, fed, OMNI_MAX_WHEELS);
    const bool judged = omni_controllers[config->controller]->margin(config, &bound, state->margin);
    const omni_flag_t open = judged && !margin_is_positive(state->margin);
    const omni_real_t period_s = (omni_real_t)margin_period_ticks * config->step_s;
    const omni_real_t change = omni_select(open, period_s, -period_s);
    state->violated_s = omni_clampf(state->violated_s + change, 0.0f, debounce_s);
    const omni_flag_t settled = state->violated_s == 0.0f || state->violated_s == debounce_s;
    state->violated = omni_select(settled, state->violated_s > 0.0f, state->violated);
}

omni_uint_t omni_robot_gain_margin(omni_gain_margin_t *state, const omni_robot_config_t *config,
                                   const omni_pose_ekf_state_t *ekf, const omni_estimate_t *estimate,
                                   const omni_target_t *target) {
    if (!target->position_loop || omni_controllers[config->controller]->margin == NULL) {
        memset(state, 0, sizeof *state);
    } else {
        if (state->ticks == 0) {
            update_gain_margin(state, config, ekf, estimate);
        }
        state->ticks = (uint8_t)((state->ticks + 1) % margin_period_ticks);
    }
    return omni_select(state->violated, (uint32_t)OMNI_WARN_ISMC_GAIN, 0u);
}
