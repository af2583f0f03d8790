/* SPDX-License-Identifier: MIT */
/* Functions of the core that the tick and the planner do not call: studies, the host and the firmware's background do.
 */
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

/* On the host. What asks for no twist is not stepped. */
static void controllers(void) {
    static omni_robot_config_t config;
    static omni_control_state_t control;
    omni_pose_t pose;
    omni_twist_t rate;
    omni_reference_t reference;
    for (int mode = 0; mode <= OMNI_CTL_MODE_COUNT; ++mode) {
        ANYTHING(config);
        ANYTHING(control);
        ANYTHING(pose);
        ANYTHING(rate);
        ANYTHING(reference);
        config.controller = (uint8_t)mode;
        const omni_result_t result = omni_controller_step(&control, &config, &pose, &rate, &reference, any_bool());
        const uint8_t demand = omni_controller_demand((uint8_t)mode);
        /*@ check stepped: result == OMNI_OK <==> demand == OMNI_DEMAND_TWIST; */
        omni_controllers_reset(&control);
        /*@ check in_time: control.ticks == 0; */
    }
}

void proof_rest(void) {
    controllers();
    parameters();
    filter();
    curve();
    geometry();
    numbers();
}
