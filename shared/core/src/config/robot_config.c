/* SPDX-License-Identifier: MIT */
#include <string.h>

#include "../control/controllers.h"
#include "../math/math_inline.h"

static const omni_real_t DEG = OMNI_PI_F / 180.0f;

static omni_result_t check_each(const omni_real_t *values, int32_t *bad_index) {
    for (int32_t i = 0; i < (int32_t)OMNI_PARAM_COUNT; ++i) {
        const omni_result_t result = omni_param_check(i, values[i], false);
        if (result != OMNI_OK) {
            *bad_index = i;
            return result;
        }
    }
    return OMNI_OK;
}

/* Parameters W1_x .. W4_x follow one another in the table. */
static const omni_real_t *per_wheel(const omni_real_t *values, int32_t first) {
    return &values[first];
}

static omni_result_t set_wheels(omni_robot_config_t *c, const omni_real_t *v, int32_t *bad_index) {
    const int32_t wheels = (int32_t)v[OMNI_PARAM_WHEELS];
    for (int32_t i = 0; i < wheels; ++i) {
        const int32_t encoder = OMNI_PARAM_W1_ENC_DIR + i;
        const int32_t motor = OMNI_PARAM_W1_MOT_DIR + i;
        const int32_t bad = v[encoder] == 0.0f ? encoder : (v[motor] == 0.0f ? motor : -1);
        if (bad >= 0) {
            *bad_index = bad;
            return OMNI_ERR_RANGE;
        }
        c->encoder_direction[i] = (int8_t)v[encoder];
        c->motor_direction[i] = (int8_t)v[motor];
    }
    return OMNI_OK;
}

static omni_result_t set_kinematics(omni_robot_config_t *c, const omni_real_t *v) {
    omni_kinematics_config_t k = {0};
    k.wheels = (uint8_t)v[OMNI_PARAM_WHEELS];
    for (uint8_t i = 0; i < k.wheels; ++i) {
        k.radius_m[i] = v[OMNI_PARAM_WHEEL_RADIUS] * per_wheel(v, OMNI_PARAM_W1_RSCALE)[i];
        k.distance_m[i] = v[OMNI_PARAM_WHEEL_DIST];
        k.angle_rad[i] = per_wheel(v, OMNI_PARAM_W1_ANGLE)[i] * DEG;
    }
    return omni_kinematics_init(&c->kinematics, &k);
}

static omni_result_t set_motor(omni_robot_config_t *c, const omni_real_t *v) {
    c->motor.inertia_kg_m2 = v[OMNI_PARAM_MOT_J];
    c->motor.viscous_N_m_s = v[OMNI_PARAM_MOT_B];
    c->motor.constant_N_m_A = v[OMNI_PARAM_MOT_K];
    c->motor.resistance_ohm = v[OMNI_PARAM_MOT_R];
    c->motor.inductance_H = v[OMNI_PARAM_MOT_L];
    omni_motor_kf_config_t *kf = &c->motor_kf;
    kf->mode = (uint8_t)v[OMNI_PARAM_KF_MODE];
    kf->step_s = c->step_s;
    kf->rad_per_count = c->rad_per_count;
    kf->q_speed = v[OMNI_PARAM_KF_Q_W] * v[OMNI_PARAM_KF_Q_W] * c->step_s;
    kf->q_current = v[OMNI_PARAM_KF_Q_I] * v[OMNI_PARAM_KF_Q_I] * c->step_s;
    kf->r_speed = v[OMNI_PARAM_KF_R_W] * v[OMNI_PARAM_KF_R_W];
    const omni_real_t angle_sd = v[OMNI_PARAM_KF_R_CNT] * c->rad_per_count;
    kf->r_angle = angle_sd * angle_sd;
    c->speed_gain_V_s = omni_motor_speed_gain(&c->motor);
    omni_motor_config_t on_floor = c->motor;
    if (v[OMNI_PARAM_KF_J] > 0.0f) {
        on_floor.inertia_kg_m2 = v[OMNI_PARAM_KF_J];
    }
    return omni_motor_discretise(&on_floor, c->step_s, &kf->model);
}

static void set_gyro(omni_robot_config_t *c, const omni_real_t *v) {
    omni_pose_ekf_config_t *e = &c->pose_ekf;
    c->gyro.axis = (int8_t)v[OMNI_PARAM_GYRO_AXIS];
    c->gyro.scale = v[OMNI_PARAM_GYRO_SCALE];
    c->gyro.range_rad_s = v[OMNI_PARAM_GYRO_MAX];
    e->has_gyro = c->gyro.axis != 0;
    e->q_gyro = v[OMNI_PARAM_GYRO_ND] * v[OMNI_PARAM_GYRO_ND] * c->step_s;
    e->q_bias = v[OMNI_PARAM_GYRO_BRW] * v[OMNI_PARAM_GYRO_BRW] * c->step_s;
    e->p_bias = v[OMNI_PARAM_GYRO_B_SD] * v[OMNI_PARAM_GYRO_B_SD];
    e->p_scale = v[OMNI_PARAM_GYRO_S_SD] * v[OMNI_PARAM_GYRO_S_SD];
}

static omni_real_t flow_square(omni_real_t value) {
    return value * value;
}

static void set_flow(omni_robot_config_t *c, const omni_real_t *v) {
    omni_flow_config_t *f = &c->flow;
    const uint8_t mode = (uint8_t)v[OMNI_PARAM_FLOW_MODE];
    f->axes = mode == OMNI_FLOW_MODE_OFF ? 0 : (mode == OMNI_FLOW_MODE_XY ? 2 : 3);
    f->lever_arm_m[0] = v[OMNI_PARAM_FLOW_X];
    f->lever_arm_m[1] = v[OMNI_PARAM_FLOW_Y];
    omni_sincosf(v[OMNI_PARAM_FLOW_ANGLE] * DEG, &f->mount_sine, &f->mount_cosine);
    f->scale = v[OMNI_PARAM_FLOW_SCALE];
    f->r_xy = flow_square(v[OMNI_PARAM_FLOW_SD]);
    f->r_relative = flow_square(v[OMNI_PARAM_FLOW_SHARE]);
    f->r_turn = flow_square(v[OMNI_PARAM_FLOW_T_SD]);
    f->delay_us = (uint32_t)(v[OMNI_PARAM_FLOW_DELAY] * 1e6f + 0.5f);
    c->pose_ekf.flow_gate = v[OMNI_PARAM_FLOW_GATE];
}

/*
 * Creep of four redundant wheels: they always push against each other a little, and rubber creeps by 1.5 mm/s under 3 N
 * (2000 N s/m), for about a second in one direction. It must not be estimated as slip. Equivalent white noise of the
 * integral over a time: twice the variance times the correlation time of 1 s.
 */
static const omni_real_t NULL_CREEP_m2_s = 2.0f * 1.5e-3f * 1.5e-3f * 1.0f;

static void set_pose_ekf(omni_robot_config_t *c, const omni_real_t *v) {
    omni_pose_ekf_config_t *e = &c->pose_ekf;
    e->mode = (uint8_t)v[OMNI_PARAM_EKF_MODE];
    e->step_s = c->step_s;
    e->q_xy = v[OMNI_PARAM_EKF_Q_XY] * v[OMNI_PARAM_EKF_Q_XY] * c->step_s;
    e->q_theta = v[OMNI_PARAM_EKF_Q_TH] * v[OMNI_PARAM_EKF_Q_TH] * c->step_s;
    e->q_slip = v[OMNI_PARAM_EKF_Q_SLIP] * v[OMNI_PARAM_EKF_Q_SLIP] * c->step_s;
    e->p_slip = v[OMNI_PARAM_EKF_P_SLIP] * v[OMNI_PARAM_EKF_P_SLIP];
    e->r_xy = v[OMNI_PARAM_EKF_R_XY] * v[OMNI_PARAM_EKF_R_XY];
    e->r_theta = v[OMNI_PARAM_EKF_R_TH] * v[OMNI_PARAM_EKF_R_TH];
    const omni_real_t count_m = c->kinematics.radius_m[0] * c->rad_per_count;
    /* Both ends of the slot are rounded to a count: 2 / 12. */
    e->r_count = count_m * count_m / 6.0f;
    e->r_null = e->r_count + NULL_CREEP_m2_s * (omni_real_t)OMNI_EKF_SLOT_TICKS * c->step_s;
    e->gate = v[OMNI_PARAM_EKF_GATE];
    e->adapt_rate = v[OMNI_PARAM_EKF_ADAPT];
    e->dead_reckoning_noise = v[OMNI_PARAM_EKF_ALONE] * v[OMNI_PARAM_EKF_ALONE] - 1.0f;
    e->gate_restart = (uint16_t)v[OMNI_PARAM_EKF_GATE_N];
    const omni_real_t slot_s = (omni_real_t)OMNI_EKF_SLOT_TICKS * c->step_s;
    const omni_real_t return_s = v[OMNI_PARAM_EKF_RETURN];
    e->mean_reversion = return_s > 0.0f ? slot_s / (return_s > slot_s ? return_s : slot_s) : 0.0f;
}

/* Configure all controllers, so that all gains are checked. The one in use comes last, see controllers.h. */
static omni_result_t set_controllers(omni_robot_config_t *c, const omni_real_t *v, int32_t *bad_index) {
    omni_result_t result = OMNI_OK;
    c->controller = (uint8_t)v[OMNI_PARAM_CTL_MODE];
    c->control_period = (uint8_t)v[OMNI_PARAM_CTL_PERIOD];
    c->slip_feedforward = v[OMNI_PARAM_ISMC_SLIP];
#define OMNI_ROW(NAME, name)                                                                                           \
    if (result == OMNI_OK) {                                                                                           \
        result = omni_configure_##name(c, v, bad_index);                                                               \
    }
    OMNI_CTL_MODE_ROWS(OMNI_ROW)
#undef OMNI_ROW
#define OMNI_ROW(NAME, name)                                                                                           \
    if (result == OMNI_OK && c->controller == OMNI_CTL_MODE_##NAME) {                                                  \
        result = omni_configure_##name(c, v, bad_index);                                                               \
    }
    OMNI_CTL_MODE_ROWS(OMNI_ROW)
#undef OMNI_ROW
    return result;
}

/* n^T r phi' = 0 for all body motions [omni/kinematics.h]; so torques and voltages along n r do not move the body. */
static void set_null_direction(omni_wheel_speed_config_t *w, const omni_kinematics_t *k) {
    omni_real_t length2 = 0.0f;
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        w->null_direction[i] = k->has_null ? k->null[i] * k->radius_m[i] : 0.0f;
        length2 += w->null_direction[i] * w->null_direction[i];
    }
    const omni_real_t per_length = length2 > 0.0f ? 1.0f / omni_sqrtf(length2) : 0.0f;
    for (int i = 0; i < OMNI_MAX_WHEELS; ++i) {
        w->null_direction[i] *= per_length;
    }
}

/* Body inertia relative to the wheel's, see omni_kinematics_add_body_inertia. */
static void set_body_load(omni_robot_config_t *c, const omni_real_t *v) {
    const omni_real_t share = v[OMNI_PARAM_WS_FF_BODY];
    c->body_load.used = share > 0.0f;
    c->body_load.mass_m2 = share * v[OMNI_PARAM_MASS] / v[OMNI_PARAM_MOT_J];
    c->body_load.inertia = share * v[OMNI_PARAM_INERTIA] / v[OMNI_PARAM_MOT_J];
}

static void set_wheel_speed(omni_robot_config_t *c, const omni_real_t *v) {
    omni_wheel_speed_config_t *w = &c->wheel_speed;
    w->wheels = c->kinematics.wheels;
    w->pid.kp = v[OMNI_PARAM_WS_P];
    w->pid.ki = v[OMNI_PARAM_WS_I];
    w->pid.kd = v[OMNI_PARAM_WS_D];
    w->pid.derivative_time_s = v[OMNI_PARAM_WS_D_TC];
    w->pid.integral_limit = v[OMNI_PARAM_WS_I_MAX];
    w->pid.step_s = c->step_s;
    w->ff_speed_V_s = v[OMNI_PARAM_WS_FF] * omni_motor_speed_gain(&c->motor);
    w->ff_acceleration_V_s2 = v[OMNI_PARAM_WS_FF] * omni_motor_acceleration_gain(&c->motor);
    w->ff_static_V = v[OMNI_PARAM_WS_FF_S];
    w->duty_limit = v[OMNI_PARAM_LIM_DUTY];
    set_null_direction(w, &c->kinematics);
}

static void set_limits(omni_robot_config_t *c, const omni_real_t *v) {
    omni_limits_t *l = &c->limits;
    l->wheel_rad_s = v[OMNI_PARAM_LIM_WHEEL];
    l->speed_m_s = v[OMNI_PARAM_LIM_V];
    l->turn_rad_s = v[OMNI_PARAM_LIM_W];
    l->acceleration_m_s2 = v[OMNI_PARAM_LIM_A];
    l->position_m = v[OMNI_PARAM_LIM_POS];
    l->wheel_speed_fraction = v[OMNI_PARAM_TRJ_MARGIN];
    l->command_timeout_s = v[OMNI_PARAM_SAFE_CMD_TO];
    l->link_timeout_s = v[OMNI_PARAM_SAFE_LINK_TO];
    l->fix_timeout_s = v[OMNI_PARAM_FIX_TIMEOUT];
    c->tracked_x_m = v[OMNI_PARAM_FIX_X];
    c->tracked_y_m = v[OMNI_PARAM_FIX_Y];
    c->tracked_heading_rad = v[OMNI_PARAM_FIX_TH];
    l->error_m = v[OMNI_PARAM_SAFE_ERR_XY];
    l->error_rad = v[OMNI_PARAM_SAFE_ERR_TH];
    l->stall_s = v[OMNI_PARAM_SAFE_STALL_T];
    l->stall_V = v[OMNI_PARAM_SAFE_STALL_V];
    l->volt_ticks_per_count_V = c->rad_per_count * c->speed_gain_V_s / (0.1f * c->step_s);
    l->battery_min_V = v[OMNI_PARAM_BAT_V_MIN];
    l->supply_nominal_V = v[OMNI_PARAM_BAT_V_NOM];
    l->driver_failures = (uint16_t)v[OMNI_PARAM_SAFE_I2C_N];
}

/* The stall threshold must be below the voltage of a blocked wheel at its current limit. */
static void set_current(omni_robot_config_t *c, const omni_real_t *v) {
    const omni_real_t stall_fraction = 0.9f; /* of the limit's voltage: margin for noise of the estimated speed */
    omni_current_configure(&c->current, v[OMNI_PARAM_LIM_I], v[OMNI_PARAM_SAFE_I], v[OMNI_PARAM_SAFE_I_TC],
                           c->motor.constant_N_m_A, c->motor.resistance_ohm, c->motor.inductance_H, c->rad_per_count,
                           c->step_s);
    if (c->current.limit_enabled && stall_fraction * c->current.limit_V < c->limits.stall_V) {
        c->limits.stall_V = stall_fraction * c->current.limit_V;
    }
}

static void set_trajectory(omni_robot_config_t *c, const omni_real_t *v) {
    omni_trajectory_config_t *t = &c->trajectory;
    t->type = (uint8_t)v[OMNI_PARAM_TRJ_TYPE];
    t->rotation = (uint8_t)v[OMNI_PARAM_TRJ_ROT];
    t->petals = (uint16_t)v[OMNI_PARAM_TRJ_PETALS];
    t->size_m = v[OMNI_PARAM_TRJ_SIZE];
    t->period_s = v[OMNI_PARAM_TRJ_PERIOD];
    t->laps = v[OMNI_PARAM_TRJ_LAPS];
    t->rotation_amplitude_rad = v[OMNI_PARAM_TRJ_ROT_AMP];
    t->rotation_cycles = v[OMNI_PARAM_TRJ_ROT_N];
    t->seed = (uint32_t)v[OMNI_PARAM_TRJ_SEED];
    t->scale = v[OMNI_PARAM_TRJ_SCALE] != 0.0f;
    t->margin = v[OMNI_PARAM_TRJ_MARGIN];
    t->ramp_s = v[OMNI_PARAM_TRJ_RAMP];
    t->wheel_limit_rad_s = v[OMNI_PARAM_LIM_WHEEL];
    t->voltage_limit_V = v[OMNI_PARAM_BAT_V_NOM] * v[OMNI_PARAM_LIM_DUTY];
    t->ff_speed_V_s = omni_motor_speed_gain(&c->motor);
    t->ff_acceleration_V_s2 = omni_motor_acceleration_gain(&c->motor);
    t->body_load = c->body_load;
    t->lead_in_m_s2 = v[OMNI_PARAM_LIM_A];
    t->lead_in_rad_s2 = v[OMNI_PARAM_LIM_A] / v[OMNI_PARAM_WHEEL_DIST];
}

omni_result_t omni_robot_config(omni_robot_config_t *config, const omni_real_t *values, int32_t *bad_index) {
    int32_t unused = -1;
    int32_t *bad = bad_index ? bad_index : &unused;
    *bad = -1;
    memset(config, 0, sizeof *config);
    omni_result_t result = check_each(values, bad);
    if (result != OMNI_OK) {
        return result;
    }
    config->step_s = (omni_real_t)OMNI_TICK_US * 1e-6f;
    config->rad_per_count = 2.0f * OMNI_PI_F / values[OMNI_PARAM_ENC_CPR];
    result = set_wheels(config, values, bad);
    if (result == OMNI_OK) {
        result = set_kinematics(config, values);
    }
    if (result == OMNI_OK) {
        result = set_motor(config, values);
    }
    if (result == OMNI_OK) {
        result = set_controllers(config, values, bad);
    }
    if (result != OMNI_OK) {
        return result;
    }
    set_pose_ekf(config, values);
    set_gyro(config, values);
    set_flow(config, values);
    set_body_load(config, values);
    set_wheel_speed(config, values);
    set_limits(config, values);
    set_current(config, values);
    set_trajectory(config, values);
    return OMNI_OK;
}
