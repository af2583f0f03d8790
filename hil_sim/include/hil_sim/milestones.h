/* SPDX-License-Identifier: MIT */
/** @file milestones.h  Milestones of a run: start and end of the path, stop. */
#ifndef HIL_SIM_MILESTONES_H
#define HIL_SIM_MILESTONES_H

#include "hil_sim/real.h"
#include "omni/types.h"

/** Times are those of the world; UINT64_MAX: not yet. */
typedef struct hil_milestones_t {
    hil_time_t path_start_us; /**< first armed tick on the path */
    hil_time_t done_us;       /**< first armed tick after the path's end */
    hil_time_t stopped_us;    /**< first tick not armed after an armed one */
    bool was_armed;
} hil_milestones_t;

void hil_milestones_init(hil_milestones_t *milestones);

/** Add a tick. @param state omni_safety_state_t. @param phase omni_trajectory_phase_t. */
void hil_milestones_tick(hil_milestones_t *milestones, uint64_t time_us, uint32_t state, omni_uint_t phase);

#endif
