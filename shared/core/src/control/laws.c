/* SPDX-License-Identifier: MIT */
/* Table rows of the controllers in control/. */
#include <stddef.h>
#include <string.h>

#include "../model/kinematics_inline.h"
#include "controllers.h"
#include "pose_control.h"

static void controller_reset_none(omni_control_state_t *control) {
    (void)control;
}

static void controller_step_none(omni_control_state_t *control, const omni_robot_config_t *config,
                                 const omni_estimate_t *estimate, const omni_reference_t *reference,
                                 omni_flag_t saturated) {
    (void)control;
    (void)config;
    (void)estimate;
    (void)reference;
    (void)saturated;
}

static void controller_reset_ismc(omni_control_state_t *control) {
    omni_ismc_reset(&control->ismc);
}

static void controller_step_ismc(omni_control_state_t *control, const omni_robot_config_t *config,
                                 const omni_estimate_t *estimate, const omni_reference_t *reference,
                                 omni_flag_t saturated) {
    const omni_twist_t world = omni_ismc_step(&control->ismc, &config->ismc, &estimate->pose, &reference->pose,
                                              &reference->rate, saturated, &control->demand.terms);
    control->demand.twist = omni_rotate_to_body(&world, &estimate->heading);
}

/* Super-twisting has another condition, on the rate of the slip error: the margin is reported without a warning. */
static bool controller_margin_ismc(const omni_robot_config_t *config, const omni_twist_t *slip,
                                   omni_real_t margin[OMNI_AXES]) {
    omni_ismc_gain_margin(&config->ismc, slip, margin);
    return config->ismc.switching != OMNI_ISMC_SWITCH_SUPER_TWISTING;
}

static void controller_reset_fl(omni_control_state_t *control) {
    omni_fl_reset(&control->fl);
}

/* P, PD and PID differ in their gains only: omni_robot_config sets the others to 0. */
static void controller_step_fl(omni_control_state_t *control, const omni_robot_config_t *config,
                               const omni_estimate_t *estimate, const omni_reference_t *reference,
                               omni_flag_t saturated) {
    const omni_twist_t world = omni_fl_step(&control->fl, &config->fl, &estimate->pose, &estimate->rate,
                                            &reference->pose, &reference->rate, saturated, &control->demand.terms);
    control->demand.twist = omni_rotate_to_body(&world, &estimate->heading);
}

static void controller_reset_original(omni_control_state_t *control) {
    omni_original_reset(&control->original);
    memset(&control->demand.terms, 0, sizeof control->demand.terms);
}

static void controller_step_original(omni_control_state_t *control, const omni_robot_config_t *config,
                                     const omni_estimate_t *estimate, const omni_reference_t *reference,
                                     omni_flag_t saturated) {
    omni_demand_t *demand = &control->demand;
    (void)saturated;
    omni_original_step(&control->original, &config->original, &config->kinematics, estimate->delta_counts,
                       &estimate->pose, &reference->pose, &reference->rate, estimate->supply_V);
    omni_pose_error(&estimate->pose, &reference->pose, demand->terms.error); /* the other terms stay 0 */
    memcpy(demand->wheel_rad_s, control->original.wheel_reference, sizeof demand->wheel_rad_s);
    memcpy(demand->voltage_V, control->original.voltage_V, sizeof demand->voltage_V);
}

static void controller_step_torque(omni_control_state_t *control, const omni_robot_config_t *config,
                                   const omni_estimate_t *estimate, const omni_reference_t *reference,
                                   omni_flag_t saturated) {
    omni_demand_t *demand = &control->demand;
    (void)saturated;
    demand->torque_scale = omni_direct_torque_step(&config->direct_torque, &config->kinematics, &estimate->pose,
                                                   &estimate->rate, reference, demand->torque_N_m, &demand->terms);
}

const omni_controller_t omni_controller_row_none = {OMNI_DEMAND_NONE, controller_reset_none, controller_step_none,
                                                    NULL};
const omni_controller_t omni_controller_row_ismc = {OMNI_DEMAND_TWIST, controller_reset_ismc, controller_step_ismc,
                                                    controller_margin_ismc};
const omni_controller_t omni_controller_row_p = {OMNI_DEMAND_TWIST, controller_reset_fl, controller_step_fl, NULL};
const omni_controller_t omni_controller_row_pd = {OMNI_DEMAND_TWIST, controller_reset_fl, controller_step_fl, NULL};
const omni_controller_t omni_controller_row_pid = {OMNI_DEMAND_TWIST, controller_reset_fl, controller_step_fl, NULL};
const omni_controller_t omni_controller_row_original = {OMNI_DEMAND_VOLTAGE, controller_reset_original,
                                                        controller_step_original, NULL};
const omni_controller_t omni_controller_row_torque = {OMNI_DEMAND_TORQUE, controller_reset_none, controller_step_torque,
                                                      NULL};
