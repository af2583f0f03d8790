/* SPDX-License-Identifier: MIT */
#include "hil_sim/run.h"

#include <string.h>

#include "in_process.h"
#include "omni/loop.h"
#include "record.h"

hil_result_t hil_run_init(hil_run_t *run, const hil_world_config_t *world, const omni_robot_config_t *robot, char *why,
                          uint32_t why_size) {
    const hil_result_t result = hil_world_init(&run->world, world, why, why_size);
    if (result != HIL_OK) {
        return result;
    }
    memset(&run->inputs, 0, sizeof run->inputs);
    memset(&run->outputs, 0, sizeof run->outputs);
    hil_metrics_init(&run->metrics);
    run->record = NULL;
    run->ticks = 0;
    run->config_used = 0;
    run->plan_used = 0;
    run->config[0] = *robot;
    omni_robot_init(&run->robot, &run->config[0]);
    return HIL_OK;
}

const omni_robot_config_t *hil_run_config(const hil_run_t *run) {
    return &run->config[run->config_used];
}

void hil_run_set_config(hil_run_t *run, const omni_robot_config_t *config) {
    run->config_used ^= 1u;
    run->config[run->config_used] = *config;
    omni_robot_set_config(&run->robot, &run->config[run->config_used]);
}

omni_result_t hil_run_start_trajectory(hil_run_t *run) {
    const omni_robot_config_t *config = hil_run_config(run);
    omni_trajectory_t *plan = &run->plan[run->plan_used ^ 1u];
    const omni_result_t result =
        omni_trajectory_plan(plan, &config->trajectory, &config->kinematics, NULL, &run->outputs.pose);
    if (result == OMNI_OK) {
        run->plan_used ^= 1u;
        omni_start_trajectory(&run->inputs, plan);
    }
    return result;
}

void hil_run_advance(hil_run_t *run, uint64_t ticks) {
    for (uint64_t tick = 0; tick < ticks; tick++) {
        hil_in_process_tick(&run->world, &run->robot, &run->inputs, &run->outputs);
        hil_record_tick(run->record, &run->world, &run->outputs);
        hil_metrics_tick(&run->metrics, &run->world, &run->outputs);
        hil_in_process_step(&run->world);
    }
    run->ticks += ticks;
}

void hil_run_in_process(hil_world_t *world, omni_robot_t *robot, omni_inputs_t *inputs, omni_outputs_t *outputs,
                        uint64_t ticks, hil_record_t *record) {
    for (uint64_t tick = 0; tick < ticks; tick++) {
        hil_in_process_tick(world, robot, inputs, outputs);
        hil_record_tick(record, world, outputs);
        hil_in_process_step(world);
    }
}
