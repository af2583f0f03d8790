/* SPDX-License-Identifier: MIT */
#include "omni/direct_torque.h"

#include <string.h>

#include "omni/saturation.h"
#include "pose_control.h"

static const omni_real_t gravity_m_s2 = 9.80665f;

/* Fraction of a limit over which outward torque fades. */
static const omni_real_t slip_fade = 0.5f;
static const omni_real_t speed_fade = 0.1f;

/* Fraction of a wheel's excess speed removed per step. 1 would be deadbeat, without margin for delay. */
static const omni_real_t brake_gain = 0.5f;

static bool pose_inputs_are_finite(const omni_pose_t *pose, const omni_twist_t *rate,
                                   const omni_reference_t *reference) {
    return omni_motion_is_finite(pose, rate) && omni_motion_is_finite(&reference->pose, &reference->rate) &&
           omni_twist_is_finite(&reference->acceleration);
}

/* [report eq. 29], with the signs that make e'' = -K_d e' - K_p e. */
static omni_real_t wanted_acceleration(const omni_direct_torque_config_t *config, int axis, omni_real_t acceleration,
                                       omni_real_t rate_error, omni_control_terms_t *terms) {
    terms->equivalent[axis] = acceleration - config->kp[axis] * terms->error[axis];
    terms->switching[axis] = config->kd[axis] * rate_error;
    return terms->equivalent[axis] + terms->switching[axis];
}

static void rim_speeds(const omni_kinematics_t *k, const omni_twist_t *body, omni_real_t *rim) {
    for (uint8_t i = 0; i < k->wheels; ++i) {
        rim[i] = k->b[i][0] * body->vx + k->b[i][1] * body->vy + k->b[i][2] * body->wz;
    }
}

/* Forces at the wheels that make up a body wrench, least norm: f = (B+)^T W. */
static void allocate_forces(const omni_kinematics_t *k, const omni_twist_t *wrench, omni_real_t *force_N) {
    for (uint8_t i = 0; i < k->wheels; ++i) {
        force_N[i] = k->b_pinv[0][i] * wrench->vx + k->b_pinv[1][i] * wrench->vy + k->b_pinv[2][i] * wrench->wz;
    }
}

/* M a, with `a` limited so that no wheel's force exceeds friction. @return the limiting factor. */
static omni_real_t body_forces(const omni_direct_torque_config_t *config, const omni_kinematics_t *k, omni_twist_t *a,
                               omni_real_t *force_N) {
    const omni_twist_t wrench = {config->mass_kg * a->vx, config->mass_kg * a->vy, config->inertia_kg_m2 * a->wz};
    allocate_forces(k, &wrench, force_N);
    if (!(config->grip > 0.0f)) {
        return 1.0f;
    }
    const omni_real_t limit_N = config->grip * config->mass_kg * gravity_m_s2 / (omni_real_t)k->wheels;
    const omni_real_t factor = omni_saturate_direction(force_N, k->wheels, limit_N);
    a->vx *= factor;
    a->vy *= factor;
    a->wz *= factor;
    return factor;
}

/* Forces that spin the wheels up with the body: the rest of M* and N*. R' xi' = w (v_y, -v_x). */
static void wheel_forces(const omni_direct_torque_config_t *config, const omni_kinematics_t *k, const omni_twist_t *a,
                         const omni_twist_t *rate, omni_real_t *force_N) {
    const omni_twist_t body = {a->vx + rate->wz * rate->vy, a->vy - rate->wz * rate->vx, a->wz};
    omni_real_t rim_m_s2[OMNI_MAX_WHEELS] = {0};
    omni_twist_t wrench = {0.0f, 0.0f, 0.0f};
    rim_speeds(k, &body, rim_m_s2);
    for (uint8_t i = 0; i < k->wheels; ++i) {
        const omni_real_t spin_N = config->wheel_inertia_kg_m2 / (k->radius_m[i] * k->radius_m[i]) * rim_m_s2[i];
        wrench.vx += k->b[i][0] * spin_N;
        wrench.vy += k->b[i][1] * spin_N;
        wrench.wz += k->b[i][2] * spin_N;
    }
    allocate_forces(k, &wrench, force_N);
}

omni_real_t omni_direct_torque_step(const omni_direct_torque_config_t *config, const omni_kinematics_t *k,
                                    const omni_pose_t *pose, const omni_twist_t *rate,
                                    const omni_reference_t *reference, omni_real_t *torque_N_m,
                                    omni_control_terms_t *terms) {
    memset(terms, 0, sizeof *terms);
    for (uint8_t i = 0; i < k->wheels; ++i) {
        torque_N_m[i] = 0.0f;
    }
    if (!pose_inputs_are_finite(pose, rate, reference)) {
        return 0.0f;
    }
    omni_pose_error(pose, &reference->pose, terms->error);
    const omni_twist_t *wanted = &reference->rate;
    const omni_twist_t world = {
        wanted_acceleration(config, 0, reference->acceleration.vx, wanted->vx - rate->vx, terms),
        wanted_acceleration(config, 1, reference->acceleration.vy, wanted->vy - rate->vy, terms),
        wanted_acceleration(config, 2, reference->acceleration.wz, wanted->wz - rate->wz, terms),
    };
    const omni_rotation_t heading = omni_rotation(pose->theta);
    omni_twist_t body = omni_rotate_to_body(&world, &heading);
    const omni_twist_t body_rate = omni_rotate_to_body(rate, &heading);
    omni_real_t force_N[OMNI_MAX_WHEELS] = {0};
    omni_real_t spin_N[OMNI_MAX_WHEELS] = {0};
    const omni_real_t gripped = body_forces(config, k, &body, force_N);
    wheel_forces(config, k, &body, &body_rate, spin_N);
    /* [report eq. 28] */
    for (uint8_t i = 0; i < k->wheels; ++i) {
        torque_N_m[i] = k->radius_m[i] * (force_N[i] + spin_N[i]);
    }
    if (!(config->torque_limit_N_m > 0.0f)) {
        return gripped;
    }
    /* [report eq. 30] */
    return gripped * omni_saturate_direction(torque_N_m, k->wheels, config->torque_limit_N_m);
}

/* Bound on outward torque near a speed limit: fraction that is allowed, and braking torque beyond the limit. */
typedef struct bound_t {
    omni_real_t share;
    omni_real_t brake_N_m;
} bound_t;

static bound_t force_bound(const omni_direct_torque_config_t *config, omni_real_t room_m_s, omni_real_t fade_m_s,
                           omni_real_t radius_m) {
    bound_t b = {omni_clampf(room_m_s / fade_m_s, 0.0f, 1.0f), 0.0f};
    if (omni_any(room_m_s < 0.0f)) {
        omni_real_t brake_N_m = -room_m_s * brake_gain * config->wheel_inertia_kg_m2 / (radius_m * config->step_s);
        if (config->torque_limit_N_m > 0.0f) {
            brake_N_m = omni_clampf(brake_N_m, 0.0f, config->torque_limit_N_m);
        }
        b.brake_N_m = omni_select(room_m_s < 0.0f, brake_N_m, 0.0f);
    }
    return b;
}

static bound_t tighter_bound(bound_t a, bound_t b) {
    a.share = omni_minf(b.share, a.share);
    a.brake_N_m = omni_maxf(b.brake_N_m, a.brake_N_m);
    return a;
}

/* Tightest bound on torque in the direction `sign`, from rim speed and floor speed. */
static bound_t outward_bound(const omni_direct_torque_config_t *config, omni_real_t sign, omni_real_t rim_m_s,
                             omni_real_t floor_m_s, omni_real_t radius_m) {
    bound_t b = {1.0f, 0.0f};
    if (config->slip_limit_m_s > 0.0f) {
        const omni_real_t limit = config->slip_limit_m_s;
        b = tighter_bound(b, force_bound(config, limit - sign * (rim_m_s - floor_m_s), slip_fade * limit, radius_m));
    }
    if (config->wheel_limit_rad_s > 0.0f) {
        const omni_real_t limit = config->wheel_limit_rad_s * radius_m;
        b = tighter_bound(b, force_bound(config, limit - sign * rim_m_s, speed_fade * limit, radius_m));
    }
    return b;
}

omni_real_t omni_direct_torque_protect(const omni_direct_torque_config_t *config, const omni_kinematics_t *k,
                                       const omni_twist_t *floor_body, const omni_real_t *wheel_rad_s,
                                       omni_real_t *torque_N_m) {
    omni_real_t floor_m_s[OMNI_MAX_WHEELS] = {0};
    omni_real_t smallest = 1.0f;
    rim_speeds(k, floor_body, floor_m_s);
    for (uint8_t i = 0; i < k->wheels; ++i) {
        const omni_real_t rim_m_s = k->radius_m[i] * wheel_rad_s[i];
        if (config->wheel_limit_rad_s > 0.0f && omni_is_finite(floor_m_s[i])) {
            const omni_real_t fastest_m_s = config->wheel_limit_rad_s * k->radius_m[i];
            floor_m_s[i] = omni_clampf(floor_m_s[i], -fastest_m_s, fastest_m_s);
        }
        if (!omni_is_finite(torque_N_m[i]) || !omni_is_finite(rim_m_s) || !omni_is_finite(floor_m_s[i])) {
            torque_N_m[i] = 0.0f;
            smallest = 0.0f;
            continue;
        }
        const bound_t up = outward_bound(config, 1.0f, rim_m_s, floor_m_s[i], k->radius_m[i]);
        const bound_t down = outward_bound(config, -1.0f, rim_m_s, floor_m_s[i], k->radius_m[i]);
        const omni_real_t asked = torque_N_m[i];
        const omni_real_t inward = omni_select(asked < 0.0f, down.share, 1.0f);
        const omni_real_t left = omni_select(asked > 0.0f, up.share, inward);
        const omni_real_t kept = left * asked;
        const omni_flag_t brakes_up = up.brake_N_m > 0.0f && kept > -up.brake_N_m;
        const omni_flag_t brakes_down = down.brake_N_m > 0.0f && kept < down.brake_N_m;
        const omni_real_t raised = omni_select(brakes_down, down.brake_N_m, kept);
        torque_N_m[i] = omni_select(brakes_up, -up.brake_N_m, raised);
        const omni_real_t share = omni_select(brakes_up || brakes_down, 0.0f, left);
        smallest = omni_minf(share, smallest);
    }
    return smallest;
}
