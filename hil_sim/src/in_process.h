/* SPDX-License-Identifier: MIT */
/** @file in_process.h  A tick of the loop that is closed in this process. */
#ifndef HIL_SIM_IN_PROCESS_H
#define HIL_SIM_IN_PROCESS_H

#include "hil_sim/world.h"
#include "omni/robot.h"

/** Sense, decide, drive: everything up to the world's step. */
void hil_in_process_tick(hil_world_t *world, omni_robot_t *robot, omni_inputs_t *inputs, omni_outputs_t *outputs);

/** The step to the next tick. */
void hil_in_process_step(hil_world_t *world);

#endif
