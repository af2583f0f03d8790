/* SPDX-License-Identifier: MIT */
/** @file record.h  Rows of a run's record. */
#ifndef HIL_SIM_RECORD_H
#define HIL_SIM_RECORD_H

#include "hil_sim/runner.h"

/** Row for this tick with the truth filled in, or NULL if none is due or there is no room. @param record may be NULL.
 */
hil_sample_t *hil_record_row(hil_record_t *record, const hil_world_t *world);

/** Add the tick that the robot has just decided, if a row is due. @param record may be NULL. */
void hil_record_tick(hil_record_t *record, const hil_world_t *world, const omni_outputs_t *outputs);

#endif
