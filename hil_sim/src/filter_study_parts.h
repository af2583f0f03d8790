/* SPDX-License-Identifier: MIT */
/** @file filter_study_parts.h  The truth of the filter study, and the control core's filters and controller around it. */
#ifndef HIL_SIM_FILTER_STUDY_PARTS_H
#define HIL_SIM_FILTER_STUDY_PARTS_H

#include <math.h>

#include "hil_sim/filter_study.h"
#include "omni/ismc.h"
#include "omni/motor_kf.h"
#include "omni/pose_ekf.h"

#define HIL_FILTER_PI 3.14159265358979323846

/** Standard normals of one step: motors (w, i per wheel), measured speeds, pose, fix. */
enum { HIL_FILTER_NORMALS = 20 };

typedef struct hil_filter_truth_t {
    double motor[4][2];     /**< w [rad/s], i [A] */
    double open_loop[4][2]; /**< the same without noise */
    double measured[4];     /**< rad/s */
    double pose[3];         /**< theta not wrapped */
    double to_body[3][4];   /**< wheel speed [rad/s] -> body twist [m/s, rad/s] */
    double motor_sd[2];
    double measured_sd;
    double pose_sd[2];
    double fix_sd[2];
    double normal[HIL_FILTER_NORMALS]; /**< of this step */
    uint64_t seed;
} hil_filter_truth_t;

void hil_filter_truth_reset(hil_filter_truth_t *truth, const hil_filter_config_t *config, const double *pose, uint64_t seed);

/** Draw the step's noise, move the motors and measure their speeds. */
void hil_filter_truth_motors(hil_filter_truth_t *truth, const hil_filter_config_t *config, const omni_real_t *voltage_V,
                             uint32_t step);

/** Move the pose and measure it. @param filtered rad/s, used if the truth follows the filter. */
void hil_filter_truth_pose(hil_filter_truth_t *truth, const hil_filter_config_t *config, const omni_real_t *filtered,
                           double *fix);

/** A fix of `pose` with this step's noise (eq. 58). */
void hil_filter_truth_fix(const hil_filter_truth_t *truth, const double *pose, double *fix);

/** Wheel speed that stands for "no filter", rad/s. */
double hil_filter_raw_speed(const hil_filter_config_t *config, const hil_filter_truth_t *truth, uint32_t wheel);

/** The control core's side. */
typedef struct hil_filter_stack_t {
    omni_kinematics_t kinematics;
    omni_ismc_config_t ismc_config;
    omni_ismc_state_t ismc;
    omni_motor_kf_config_t kf_config;
    omni_motor_kf_state_t kf[4];
    omni_pose_ekf_config_t ekf_config[HIL_FILTER_COUNT];
    omni_pose_ekf_state_t ekf[HIL_FILTER_COUNT];
    omni_real_t voltage[4];  /**< V */
    omni_real_t filtered[4]; /**< rad/s */
    uint64_t step_us;
} hil_filter_stack_t;

/** Start at `pose`, known exactly. @return false if the core refuses the geometry. */
bool hil_filter_stack_reset(hil_filter_stack_t *stack, const hil_filter_config_t *config, const double *pose);

/** Voltages for this step (eq. 39-43). */
void hil_filter_control(hil_filter_stack_t *stack, const hil_filter_config_t *config, const double *reference,
                        const double *rate);

/** Filter the measured wheel speeds (eq. 45-56). */
void hil_filter_motors(hil_filter_stack_t *stack, const hil_filter_config_t *config, const double *measured);

/** The four pose estimates (eq. 57-69). @param fix overwritten if each EKF measures itself. */
void hil_filter_estimate(hil_filter_stack_t *stack, const hil_filter_config_t *config, const hil_filter_truth_t *truth,
                         double *fix, uint32_t step);

/** Normalised innovation squared of the motor filters, mean over the wheels. */
double hil_filter_motor_nis(const hil_filter_stack_t *stack, uint32_t wheels);

#endif
