/* SPDX-License-Identifier: MIT */
/**
 * @file filter_study_parts.h
 * The truth of the filter study, the control core's filters and controller around it, and the sums of a run. Compiled
 * for one run and, with other numbers, for eight at once (hil_sim/lanes).
 */
#ifndef HIL_SIM_FILTER_STUDY_PARTS_H
#define HIL_SIM_FILTER_STUDY_PARTS_H

#include "hil_sim/filter_study.h"
#include "omni/ismc.h"
#include "omni/motor_kf.h"
#include "omni/pose_ekf.h"
#include "real_math.h"

/** Standard normals of one step: motors (w, i per wheel), measured speeds, pose, fix. */
enum { HIL_FILTER_NORMALS = 18 };

typedef struct hil_filter_truth_t {
    hil_real_t motor[4][2];     /**< w [rad/s], i [A] */
    hil_real_t open_loop[4][2]; /**< the same without noise, if the setting asks for it */
    hil_real_t measured[4];     /**< rad/s */
    hil_real_t pose[3];         /**< theta not wrapped */
    double to_move[3][4];       /**< wheel speed [rad/s] -> motion of the body in a step [m, rad] */
    double motor_sd[2];
    double measured_sd;
    double pose_sd[2];
    double fix_sd[2];
    omni_real_t normal[HIL_FILTER_NORMALS]; /**< of this step */
    omni_uint_t seed[2];                    /**< low, high word */
} hil_filter_truth_t;

void hil_filter_truth_reset(hil_filter_truth_t *truth, const hil_filter_config_t *config, const double *pose,
                            const omni_uint_t *seed);

/** Draw the step's noise, move the motors and measure their speeds. */
void hil_filter_truth_motors(hil_filter_truth_t *truth, const hil_filter_config_t *config, const omni_real_t *voltage_V,
                             uint32_t step);

/** Move the pose and measure it. @param filtered rad/s, used if the truth follows the filter. */
void hil_filter_truth_pose(hil_filter_truth_t *truth, const hil_filter_config_t *config, const omni_real_t *filtered,
                           hil_real_t *fix);

/** A fix of `pose` with this step's noise (eq. 58). */
void hil_filter_truth_fix(const hil_filter_truth_t *truth, const hil_real_t *pose, hil_real_t *fix);

/** Wheel speed that stands for "no filter", rad/s. */
hil_real_t hil_filter_raw_speed(const hil_filter_config_t *config, const hil_filter_truth_t *truth, uint32_t wheel);

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
void hil_filter_motors(hil_filter_stack_t *stack, const hil_filter_config_t *config, const hil_real_t *measured);

/** The four pose estimates (eq. 57-69). @param fix overwritten if each EKF measures itself. */
void hil_filter_estimate(hil_filter_stack_t *stack, const hil_filter_config_t *config, const hil_filter_truth_t *truth,
                         hil_real_t *fix, uint32_t step);

/** Normalised innovation squared of the motor filters, mean over the wheels. */
omni_real_t hil_filter_motor_nis(const hil_filter_stack_t *stack, uint32_t wheels);

/** Sums over the steps, in the order of hil_filter_result_t's members; squares in place of their roots. */
typedef struct hil_filter_sums_t {
    hil_real_t square[HIL_FILTER_COUNT][3];
    hil_real_t closer[HIL_FILTER_COUNT];
    hil_real_t final_error[HIL_FILTER_COUNT][3];
    hil_real_t final_p[2][3][3];
    hil_real_t nis[2];
    hil_real_t motor_nis;
    hil_real_t tracking[3];
} hil_filter_sums_t;

typedef struct hil_filter_run_t {
    hil_filter_truth_t truth;
    hil_filter_stack_t stack;
    hil_filter_sums_t sums;
} hil_filter_run_t;

/** Start a run. @param seed low, high word. @return false if the core refuses the geometry. */
bool hil_filter_begin(hil_filter_run_t *run, const hil_filter_config_t *config, const double *reference,
                      const omni_uint_t *seed);

/** One step. @param reference, rate of the whole run. @param fix of this step. */
void hil_filter_step(hil_filter_run_t *run, const hil_filter_config_t *config, const double *reference,
                     const double *rate, uint32_t step, hil_real_t *fix);

/** Fill in what `sums` says of the last step. */
void hil_filter_end(hil_filter_run_t *run);

#endif
