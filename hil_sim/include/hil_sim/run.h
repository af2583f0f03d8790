/* SPDX-License-Identifier: MIT */
/**
 * @file run.h
 * An in-process run: world, robot, their interface, configurations and metrics.
 */
#ifndef HIL_SIM_RUN_H
#define HIL_SIM_RUN_H

#include "hil_sim/metrics.h"
#include "hil_sim/runner.h"
#include "hil_sim/world.h"
#include "omni/robot.h"

/**
 * Must not be moved: robot and inputs point into it. `config` and `plan` are double-buffered, because the robot may use
 * the old one until its next tick.
 */
typedef struct hil_run_t {
    hil_world_t world;
    omni_robot_t robot;
    omni_inputs_t inputs;
    omni_outputs_t outputs; /**< of the last tick */
    hil_metrics_t metrics;
    hil_record_t *record; /**< NULL: none */
    uint64_t ticks;       /**< run so far */
    omni_robot_config_t config[2];
    omni_trajectory_t plan[2];
    uint8_t config_used; /**< index in use */
    uint8_t plan_used;
} hil_run_t;

/**
 * Start at time zero without a record. @param robot is copied. @param why out, text of at most `why_size` bytes naming
 * the invalid field of the world.
 */
hil_result_t hil_run_init(hil_run_t *run, const hil_world_config_t *world, const omni_robot_config_t *robot, char *why,
                          uint32_t why_size);

/** The configuration in use. */
const omni_robot_config_t *hil_run_config(const hil_run_t *run);

/** Set another configuration; it is copied. */
void hil_run_set_config(hil_run_t *run, const omni_robot_config_t *config);

/** Plan the configured trajectory from the estimated pose and follow it from the next tick on. @return OMNI_OK, or
 * nothing changed. */
omni_result_t hil_run_start_trajectory(hil_run_t *run);

/** Run ticks (hil_run_in_process) and accumulate the metrics. */
void hil_run_advance(hil_run_t *run, uint64_t ticks);

#endif
