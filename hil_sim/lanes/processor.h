/* SPDX-License-Identifier: MIT */
/** @file processor.h  Eight whole runs in lanes, for the best CPU level that this was built for and runs here. */
#ifndef HIL_LANES_PROCESSOR_H
#define HIL_LANES_PROCESSOR_H

#include "hil_sim/lanes.h"
#include "runs.h"

/** The best that this processor can do. @param most no level above this one. */
const hil_lanes_runs_t *hil_lanes_runs(hil_lanes_level_t most);

#endif
