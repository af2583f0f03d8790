/* SPDX-License-Identifier: MIT */
/** @file coverage.h  How many ticks were spent in what; a run that never got somewhere proves nothing about it. */
#ifndef PARITY_COVERAGE_H
#define PARITY_COVERAGE_H

#include "omni/robot.h"
#include "scene.h"

enum {
    COVERAGE_STATES = OMNI_STATE_COUNT,
    COVERAGE_KINDS = OMNI_SETPOINT_DUTY + 1,
    COVERAGE_CONTROLLERS = OMNI_CTL_MODE_COUNT,
    COVERAGE_PATHS = OMNI_TRJ_TYPE_COUNT,
    COVERAGE_ROTATIONS = OMNI_TRJ_ROT_COUNT,
    COVERAGE_BITS = 32
};

typedef struct coverage_t {
    uint32_t state[COVERAGE_STATES];
    uint32_t driven[COVERAGE_KINDS][COVERAGE_CONTROLLERS]; /**< armed */
    uint32_t path[COVERAGE_PATHS][COVERAGE_ROTATIONS];     /**< armed and on the path, not in its lead-in */
    uint32_t phase[OMNI_PHASE_DONE + 1];
    uint32_t fault[COVERAGE_BITS];
    uint32_t history[COVERAGE_BITS]; /**< stop faults that stopped an armed robot */
    uint32_t wheel_filter[OMNI_KF_MODE_ANGLE + 1];
    uint32_t pose_filter[OMNI_EKF_MODE_SLIP + 1];
    uint32_t switching[OMNI_ISMC_SWITCH_SUPER_TWISTING + 1]; /**< ISMC, armed */
    uint32_t wheels[OMNI_MAX_WHEELS + 1];                    /**< armed */
    uint32_t held;                                           /**< between two steps of the position controller */
    uint32_t cut;                                            /**< speeds or duties scaled down */
    uint32_t fixes_used;
    uint32_t fixes_refused;
    uint32_t restarts; /**< of the pose estimate */
    uint32_t gyro_leads;
    uint32_t gyro_rests;
    uint32_t gyro_rejected;
    uint32_t currents_cut;
    uint32_t flow_used;
    uint32_t flow_refused;
} coverage_t;

/** Note one tick, after it. */
void coverage_note(coverage_t *coverage, const scene_t *scene);

/** Print all figures. @return false, and say what, if something was reached in fewer than `least` ticks. */
bool coverage_report(const coverage_t *coverage, const scene_t *scene, uint32_t least);

#endif
