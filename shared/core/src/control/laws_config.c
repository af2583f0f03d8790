/* SPDX-License-Identifier: MIT */
/* Configuration of the controllers in control/ from parameters. */
#include "controllers.h"

/* xy, xy, theta */
static void set_axes(omni_real_t *axes, omni_real_t xy, omni_real_t theta) {
    axes[0] = xy;
    axes[1] = xy;
    axes[2] = theta;
}

static omni_real_t controller_period_s(const omni_robot_config_t *c) {
    return c->step_s * (omni_real_t)c->control_period;
}

/* For a controller without constraints beyond the parameters' ranges. */
static omni_result_t accept_all(int32_t *bad_index) {
    *bad_index = -1;
    return OMNI_OK;
}

omni_result_t omni_configure_none(omni_robot_config_t *c, const omni_real_t *v, int32_t *bad_index) {
    (void)c;
    (void)v;
    return accept_all(bad_index);
}

omni_result_t omni_configure_ismc(omni_robot_config_t *c, const omni_real_t *v, int32_t *bad_index) {
    c->ismc.step_s = controller_period_s(c);
    c->ismc.switching = (uint8_t)v[OMNI_PARAM_ISMC_SWITCH];
    set_axes(c->ismc.lambda, v[OMNI_PARAM_ISMC_LAM_XY], v[OMNI_PARAM_ISMC_LAM_TH]);
    set_axes(c->ismc.k, v[OMNI_PARAM_ISMC_K_XY], v[OMNI_PARAM_ISMC_K_TH]);
    set_axes(c->ismc.phi, v[OMNI_PARAM_ISMC_PHI_XY], v[OMNI_PARAM_ISMC_PHI_TH]);
    set_axes(c->ismc.integral_limit, v[OMNI_PARAM_ISMC_I_MAX], v[OMNI_PARAM_ISMC_I_MAX]);
    return accept_all(bad_index);
}

/* P, PD and PID share a module: gains that a row does not have are 0. */
static omni_result_t configure_fl(omni_robot_config_t *c, const omni_real_t *v, bool derivative, bool integral,
                                  int32_t *bad_index) {
    c->fl.step_s = controller_period_s(c);
    set_axes(c->fl.kp, v[OMNI_PARAM_FL_KP_XY], v[OMNI_PARAM_FL_KP_TH]);
    set_axes(c->fl.kd, derivative ? v[OMNI_PARAM_FL_KD_XY] : 0.0f, derivative ? v[OMNI_PARAM_FL_KD_TH] : 0.0f);
    set_axes(c->fl.ki, integral ? v[OMNI_PARAM_FL_KI_XY] : 0.0f, integral ? v[OMNI_PARAM_FL_KI_TH] : 0.0f);
    set_axes(c->fl.integral_limit, v[OMNI_PARAM_FL_I_MAX], v[OMNI_PARAM_FL_I_MAX]);
    return accept_all(bad_index);
}

omni_result_t omni_configure_p(omni_robot_config_t *c, const omni_real_t *v, int32_t *bad_index) {
    return configure_fl(c, v, false, false, bad_index);
}

omni_result_t omni_configure_pd(omni_robot_config_t *c, const omni_real_t *v, int32_t *bad_index) {
    return configure_fl(c, v, true, false, bad_index);
}

omni_result_t omni_configure_pid(omni_robot_config_t *c, const omni_real_t *v, int32_t *bad_index) {
    return configure_fl(c, v, true, true, bad_index);
}

omni_result_t omni_configure_original(omni_robot_config_t *c, const omni_real_t *v, int32_t *bad_index) {
    (void)v;
    c->original = omni_original_defaults(c->step_s, c->rad_per_count);
    return accept_all(bad_index);
}

/* The measured points, or a straight line if none are given. @return false, with the invalid parameter, if they do not
 * rise. */
static bool set_curve(omni_robot_config_t *c, const omni_real_t *v, int32_t *bad_index) {
    omni_torque_curve_t *curve = &c->torque_curve;
    int32_t point = 0;
    bool measured = false;
    curve->torque_max_N_m = v[OMNI_PARAM_DT_TAU_MAX];
    if (curve->torque_max_N_m == 0.0f) {
        curve->torque_max_N_m = c->motor.constant_N_m_A * v[OMNI_PARAM_BAT_V_NOM] / c->motor.resistance_ohm;
    }
    curve->deadband_duty = v[OMNI_PARAM_DT_DEAD];
    for (int32_t i = 0; i < OMNI_CURVE_POINTS; ++i) {
        curve->duty[i] = v[OMNI_PARAM_DT_C1 + i];
        measured = measured || curve->duty[i] != 0.0f;
    }
    for (int32_t i = 0; i < OMNI_CURVE_POINTS && !measured; ++i) {
        curve->duty[i] = curve->deadband_duty +
                         (1.0f - curve->deadband_duty) * (omni_real_t)(i + 1) / (omni_real_t)(OMNI_CURVE_POINTS + 1);
    }
    const bool rises = omni_torque_curve_is_valid(curve, &point);
    if (!rises) {
        *bad_index = OMNI_PARAM_DT_C1 + (point < OMNI_CURVE_POINTS ? point : OMNI_CURVE_POINTS - 1);
    }
    return rises;
}

omni_result_t omni_configure_torque(omni_robot_config_t *c, const omni_real_t *v, int32_t *bad_index) {
    omni_direct_torque_config_t *t = &c->direct_torque;
    if (!set_curve(c, v, bad_index)) {
        return OMNI_ERR_RANGE;
    }
    c->emf_compensation = v[OMNI_PARAM_DT_EMF];
    t->mass_kg = v[OMNI_PARAM_MASS];
    t->inertia_kg_m2 = v[OMNI_PARAM_INERTIA];
    t->wheel_inertia_kg_m2 = v[OMNI_PARAM_MOT_J];
    set_axes(t->kp, v[OMNI_PARAM_DT_KP_XY], v[OMNI_PARAM_DT_KP_TH]);
    set_axes(t->kd, v[OMNI_PARAM_DT_KD_XY], v[OMNI_PARAM_DT_KD_TH]);
    t->torque_limit_N_m = c->torque_curve.torque_max_N_m;
    t->grip = v[OMNI_PARAM_DT_GRIP];
    t->slip_limit_m_s = v[OMNI_PARAM_DT_SLIP];
    t->wheel_limit_rad_s = v[OMNI_PARAM_LIM_WHEEL];
    t->step_s = c->step_s;
    return OMNI_OK;
}
