/* SPDX-License-Identifier: MIT */
/* Functions of the core that the tick and the planner do not call: studies, the host and the firmware's background do. */
#include "any.h"

static omni_kinematics_t kinematics;

static void parameters(void) {
    char name[OMNI_PARAM_NAME_LEN + 1];
    omni_real_t values[OMNI_PARAM_COUNT];
    int32_t index;
    ANYTHING(name);
    name[OMNI_PARAM_NAME_LEN] = '\0';
    ANYTHING(index);
    const int32_t found = omni_param_find(name);
    /*@ check a_parameter: -1 <= found < OMNI_PARAM_COUNT; */
    const int32_t robot = omni_builtin_robot_find(name);
    /*@ check a_robot: -1 <= robot < omni_builtin_robot_count; */
    (void)omni_param_check(index, any_real(), any_bool());
    omni_params_defaults(values);
    const char *controller = omni_controller_name((uint8_t)Frama_C_interval(0, UINT8_MAX));
    /*@ check a_name: controller == \null || \valid_read(controller); */
}

static void filter(void) {
    omni_motor_kf_config_t config;
    omni_motor_kf_state_t state;
    ANYTHING(config);
    ANYTHING(state);
    (void)omni_motor_kf_step_speed(&state, &config, any_real(), any_real());
    omni_motor_kf_rebase(&state);
}

static void curve(void) {
    omni_torque_curve_t curve;
    ANYTHING(curve);
    int32_t point;
    (void)omni_torque_curve_is_valid(&curve, &point);
    (void)omni_torque_curve_duty(&curve, any_real());
    (void)omni_torque_curve_torque(&curve, any_real());
}

static void geometry(void) {
    omni_twist_t twist;
    omni_real_t wheels[OMNI_MAX_WHEELS], slip[OMNI_MAX_WHEELS];
    ANYTHING(kinematics);
    kinematics.has_null = any_bool();
    kinematics.wheels = (uint8_t)Frama_C_interval(0, OMNI_MAX_WHEELS);
    ANYTHING(twist);
    ANYTHING(wheels);
    ANYTHING(slip);
    omni_kinematics_inverse(&kinematics, &twist, slip, wheels);
    ANYTHING(wheels);
    omni_kinematics_forward(&kinematics, wheels, slip, &twist);
    (void)omni_kinematics_slip_residual(&kinematics, wheels);
    twist = omni_twist_to_world(&twist, any_real());
    twist = omni_twist_to_body(&twist, any_real());
}

static void numbers(void) {
    omni_pid_config_t config;
    omni_pid_state_t state;
    ANYTHING(config);
    omni_pid_reset(&state);
    (void)omni_pid_step(&state, &config, any_real(), any_real(), any_real());
    omni_pid_limited(&state, &config, any_real(), any_real());
    const omni_real_t root = omni_sqrtf(any_real());
    /*@ check root_is_a_number: root >= 0.0; */
    (void)omni_wrap_pi(any_real());
    (void)omni_atan2f(any_real(), any_real());
}

void proof_rest(void) {
    parameters();
    filter();
    curve();
    geometry();
    numbers();
}
