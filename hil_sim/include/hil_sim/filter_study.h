/* SPDX-License-Identifier: MIT */
/**
 * @file filter_study.h
 * The four filter combinations of the report's Tables 5 and 7 (eq. 45-81) on one simulated robot: truth and noise are
 * simulated here in double precision; controller and filters are the control core's.
 *
 * One step of length T: ISMC on one estimate -> voltage per wheel -> motors with noise -> measured wheel speeds,
 * filtered or not -> pose with noise. A pose fix and four estimates follow. The voltage is the wheel speed
 * command, one volt per rad/s, as in the report. Wheels are evenly spaced and do not slip. A run is a pure function of
 * configuration and seed, bit-identical in lanes and on every processor.
 */
#ifndef HIL_SIM_FILTER_STUDY_H
#define HIL_SIM_FILTER_STUDY_H

#include <stdint.h>

/** Filter combination: columns of Table 7. */
typedef enum hil_filter_t {
    HIL_FILTER_NONE = 0, /**< wheel speeds without a filter, integrated */
    HIL_FILTER_KF,       /**< wheel speeds of the motor filters, integrated */
    HIL_FILTER_EKF,      /**< wheel speeds without a filter, and pose fixes */
    HIL_FILTER_KF_EKF,   /**< wheel speeds of the motor filters, and pose fixes */
    HIL_FILTER_COUNT
} hil_filter_t;

/** Wheel speeds that move the true pose. */
typedef enum hil_filter_drive_t {
    HIL_FILTER_DRIVE_TRUE = 0, /**< the true ones */
    HIL_FILTER_DRIVE_ESTIMATE  /**< the motor filters' estimate: the truth follows the filter */
} hil_filter_drive_t;

/** Wheel speeds used for "no filter". */
typedef enum hil_filter_raw_t {
    HIL_FILTER_RAW_MEASURED = 0, /**< the measured ones */
    HIL_FILTER_RAW_OPEN_LOOP     /**< the motor model's without noise and without measurements */
} hil_filter_raw_t;

/** Pose fix z = pose + v. */
typedef enum hil_filter_fix_t {
    HIL_FILTER_FIX_FRESH = 0, /**< current pose */
    HIL_FILTER_FIX_STALE,     /**< pose of the previous step, with the current time stamp */
    HIL_FILTER_FIX_LATE,      /**< pose of the previous step, with its time stamp */
    HIL_FILTER_FIX_OWN        /**< each EKF's own prediction: no measurement at all */
} hil_filter_fix_t;

/** One setting. Variances "per step" are added in each step of step_s. */
typedef struct hil_filter_config_t {
    uint32_t steps;        /**< > 0 */
    double step_s;         /**< T, (0, 1] */
    uint32_t wheels;       /**< 3 or 4, wheel i at bearing (i + 1/2) 360 deg / wheels */
    double radius_m;       /**< > 0 */
    double distance_m;     /**< > 0 */
    double motor_a[2][2];  /**< (w [rad/s], i [A]) of the next step from this one's, truth and filter alike */
    double motor_b[2];     /**< from the voltage */
    double motor_q[2];     /**< true variances per step of w and i: (rad/s)^2, A^2 */
    double motor_r;        /**< true variance of a measured wheel speed, (rad/s)^2 */
    double pose_q[2];      /**< true variances per step of x, y [m^2] and theta [rad^2] */
    double fix_r[2];       /**< true variances of a fix of x, y [m^2] and theta [rad^2]; also assumed by the EKF */
    double kf_q[2];        /**< motor_q as assumed by the motor filters; motor_r is known */
    double ekf_q[2][2];    /**< process noise per step assumed by the EKF, x, y and theta: [0] without, [1] with motor
                              filters */
    double ismc_lambda[3]; /**< 1/s */
    double ismc_k[3];      /**< m/s, m/s, rad/s */
    uint32_t controlled;   /**< hil_filter_t whose estimate the controller gets */
    uint32_t drive;        /**< hil_filter_drive_t */
    uint32_t raw;          /**< hil_filter_raw_t */
    uint32_t fix;          /**< hil_filter_fix_t */
} hil_filter_config_t;

/** Result of one run. Axes are x [m], y [m], theta [rad]; errors are estimate - truth. */
typedef struct hil_filter_result_t {
    double rmse[HIL_FILTER_COUNT][3];
    double closer[HIL_FILTER_COUNT]; /**< fraction of the steps whose estimate is closer to the origin than the truth */
    double final_error[HIL_FILTER_COUNT][3]; /**< after the last step */
    double final_p[2][3][3];                 /**< the covariances of the EKFs then: without, with motor filters */
    double nis[2];      /**< normalised innovation squared of the EKFs, mean over the steps: 3 degrees of freedom */
    double motor_nis;   /**< of the motor filters, mean over wheels and steps: 1 degree of freedom */
    double tracking[3]; /**< RMS of truth - reference */
} hil_filter_result_t;

/** One step in full; arrays per wheel have four entries. All at the end of the step but the voltage, which acts during
 * it. */
typedef struct hil_filter_sample_t {
    double truth[3];
    double estimate[HIL_FILTER_COUNT][3]; /**< theta in [-pi, pi) */
    double fix[3];                        /**< the fix; HIL_FILTER_FIX_OWN: that of the EKF with motor filters */
    double voltage_V[4];
    double wheel_true[4];     /**< rad/s */
    double wheel_measured[4]; /**< rad/s */
    double wheel_raw[4];      /**< used for "no filter", rad/s */
    double wheel_filtered[4]; /**< rad/s */
} hil_filter_sample_t;

/**
 * Run one seed.
 * @param reference  steps + 1 poses, row k at time k T; the robot starts at row 0.
 * @param rate  steps twists of the reference as the controller gets them, m/s and rad/s.
 * @param samples  room for `steps` rows, or NULL.
 * @return 0, or -1 for a setting outside its ranges.
 */
int32_t hil_filter_study(const hil_filter_config_t *config, const double *reference, const double *rate, uint64_t seed,
                         hil_filter_result_t *result, hil_filter_sample_t *samples);

/** Instruction set for the computation. */
typedef enum hil_filter_path_t {
    HIL_FILTER_PATH_BEST = 0, /**< the fastest of the others on this processor */
    HIL_FILTER_PATH_SINGLE,   /**< one by one */
    HIL_FILTER_PATH_BASELINE, /**< eight at a time, with the instructions that every processor of this architecture has
                               */
    HIL_FILTER_PATH_AVX2,     /**< eight at a time with AVX2 */
    HIL_FILTER_PATH_AVX512    /**< sixteen at a time with AVX-512 */
} hil_filter_path_t;

/**
 * Run many seeds; threads may share the work by calling this with seeds of their own.
 * @param reference, rate  as for hil_filter_study.
 * @param results  room for `count`, in the order of the seeds.
 * @return 0, -1 for a setting outside its ranges, -2 if the processor cannot do this path.
 */
int32_t hil_filter_study_many(const hil_filter_config_t *config, const double *reference, const double *rate,
                              const uint64_t *seeds, uint32_t count, hil_filter_path_t path,
                              hil_filter_result_t *results);

#endif
