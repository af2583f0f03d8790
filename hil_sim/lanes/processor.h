/* SPDX-License-Identifier: MIT */
/** @file processor.h  Which CPU levels of lanes were built and run on this processor. */
#ifndef HIL_LANES_PROCESSOR_H
#define HIL_LANES_PROCESSOR_H

#include <stdbool.h>

#include "hil_sim/lanes.h"
#include "runs.h"

bool hil_lanes_has_avx2(void);

/** The best that this processor can do. @param most no level above this one. */
const hil_lanes_runs_t *hil_lanes_runs(hil_lanes_level_t most);

#endif
