/* SPDX-License-Identifier: MIT */
#include "../kinematics/kinematics_inline.h"
#include "robot_internal.h"

/* How sure the bound on the slip error is, in standard deviations. */
static const omni_real_t sigmas = 3.0f;

/* A violation shows after this long, and goes after as long without one. */
static const omni_real_t debounce_s = 0.5f;

/* d(world twist) / d(slip ratios): rows of R^T B+ diag(r phi'). */
static inline void sensitivity(const omni_robot_config_t *c, const omni_tick_t *tick,
                               omni_real_t rows[OMNI_AXES][OMNI_MAX_WHEELS], uint8_t wheels) {
    for (uint8_t i = 0; i < wheels; ++i) {
        const omni_real_t rim_m_s = c->kinematics.radius_m[i] * tick->out->wheel_rad_s[i];
        const omni_twist_t body = {c->kinematics.b_pinv[0][i] * rim_m_s, c->kinematics.b_pinv[1][i] * rim_m_s,
                                   c->kinematics.b_pinv[2][i] * rim_m_s};
        const omni_twist_t world = omni_rotate_to_world(&body, &tick->heading);
        rows[0][i] = world.vx;
        rows[1][i] = world.vy;
        rows[2][i] = world.wz;
    }
}

/* Largest plausible |B+ (v_s - v_s_hat)| on one axis: what of the estimate isn't fed forward, and what the estimate may be off by. */
static inline omni_real_t slip_bound(const omni_robot_t *robot, const omni_real_t *row, omni_real_t fed, uint8_t wheels) {
    const omni_robot_config_t *c = robot->config;
    const omni_pose_ekf_state_t *ekf = &robot->pose_ekf;
    const bool estimated = c->pose_ekf.mode == OMNI_EKF_MODE_SLIP;
    omni_real_t left = 0.0f;
    omni_real_t variance = 0.0f;
    for (uint8_t i = 0; i < wheels; ++i) {
        if (!estimated) {
            variance += row[i] * row[i] * c->pose_ekf.p_slip;
            continue;
        }
        left += row[i] * (1.0f - fed) * ekf->slip[i];
        for (uint8_t j = 0; j < wheels; ++j) {
            variance += row[i] * ekf->p[OMNI_AXES + i][OMNI_AXES + j] * row[j];
        }
    }
    return omni_absf(left) + sigmas * omni_sqrtf(variance);
}

static inline omni_twist_t slip_bounds(const omni_robot_t *robot, const omni_tick_t *tick, omni_real_t fed, uint8_t wheels) {
    omni_real_t rows[OMNI_AXES][OMNI_MAX_WHEELS];
    sensitivity(robot->config, tick, rows, wheels);
    return (omni_twist_t){slip_bound(robot, rows[0], fed, wheels), slip_bound(robot, rows[1], fed, wheels),
                          slip_bound(robot, rows[2], fed, wheels)};
}

static omni_flag_t covers(const omni_real_t margin[OMNI_AXES]) {
    return margin[0] >= 0.0f && margin[1] >= 0.0f && margin[2] >= 0.0f;
}

void omni_robot_gain_margin(omni_robot_t *robot, omni_tick_t *tick) {
    const omni_robot_config_t *c = robot->config;
    if (robot->state != OMNI_STATE_ARMED || !tick->position_loop || c->controller != OMNI_CTL_MODE_ISMC) {
        robot->uncovered_s = 0.0f;
        robot->uncovered = false;
        return;
    }
    const omni_real_t fed = tick->fix_is_fresh ? c->slip_feed : 0.0f;
    /* The count as a constant lets the compiler unroll the loops. */
    const omni_twist_t bound =
        c->kinematics.wheels == 3 ? slip_bounds(robot, tick, fed, 3) : slip_bounds(robot, tick, fed, OMNI_MAX_WHEELS);
    omni_ismc_gain_margin(&c->ismc, &bound, tick->out->ismc_margin);
    /* Super-twisting has a condition of its own on the rate of the slip error. */
    const bool judged = c->ismc.switching != OMNI_ISMC_SWITCH_SUPER_TWISTING;
    const omni_flag_t open = judged && !covers(tick->out->ismc_margin);
    const omni_real_t change = omni_select(open, c->step_s, -c->step_s);
    robot->uncovered_s = omni_clampf(robot->uncovered_s + change, 0.0f, debounce_s);
    const omni_flag_t settled = robot->uncovered_s == 0.0f || robot->uncovered_s == debounce_s;
    robot->uncovered = omni_select(settled, robot->uncovered_s > 0.0f, robot->uncovered);
    tick->faults |= omni_select(robot->uncovered, (uint32_t)OMNI_WARN_ISMC_GAIN, 0u);
}
