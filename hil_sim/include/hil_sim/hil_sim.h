/* SPDX-License-Identifier: MIT */
/** @file hil_sim.h  All headers of the simulated world. */
#ifndef HIL_SIM_HIL_SIM_H
#define HIL_SIM_HIL_SIM_H

#include "hil_sim/batch.h"
#include "hil_sim/dispersion.h"
#include "hil_sim/drv8871.h"
#include "hil_sim/external.h"
#include "hil_sim/figures.h"
#include "hil_sim/filter_study.h"
#include "hil_sim/lanes.h"
#include "hil_sim/metrics.h"
#include "hil_sim/milestones.h"
#include "hil_sim/pca9685.h"
#include "hil_sim/player.h"
#include "hil_sim/random.h"
#include "hil_sim/run.h"
#include "hil_sim/runner.h"
#include "hil_sim/schema.h"
#include "hil_sim/spread.h"
#include "hil_sim/timeline.h"
#include "hil_sim/waiting.h"
#include "hil_sim/world.h"

#endif
