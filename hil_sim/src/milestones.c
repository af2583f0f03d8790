/* SPDX-License-Identifier: MIT */
/* Compiled for lanes too: branches depend on the state only. */
#include "hil_sim/milestones.h"

#include "omni/robot.h"

void hil_milestones_init(hil_milestones_t *milestones) {
    milestones->path_start_us = UINT64_MAX;
    milestones->done_us = UINT64_MAX;
    milestones->stopped_us = UINT64_MAX;
    milestones->was_armed = false;
}

static void first_time(hil_time_t *kept, uint64_t time_us) {
    *kept = hil_select(*kept == UINT64_MAX, time_us, *kept);
}

void hil_milestones_tick(hil_milestones_t *milestones, uint64_t time_us, uint32_t state, omni_uint_t phase) {
    if (state == OMNI_STATE_ARMED) {
        milestones->was_armed = true;
        if (phase == OMNI_PHASE_PATH) {
            first_time(&milestones->path_start_us, time_us);
        } else if (phase == OMNI_PHASE_DONE) {
            first_time(&milestones->done_us, time_us);
        }
    } else if (milestones->was_armed) {
        first_time(&milestones->stopped_us, time_us);
    }
}
