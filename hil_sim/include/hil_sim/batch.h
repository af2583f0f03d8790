/* SPDX-License-Identifier: MIT */
/**
 * @file batch.h
 * Many runs of a scenario in one call: a row of figures each, no records. A row is a pure function of scenario and
 * seed. How many runs a call makes, and in how many threads calls are made, changes nothing.
 */
#ifndef HIL_SIM_BATCH_H
#define HIL_SIM_BATCH_H

#include "hil_sim/figures.h"
#include "hil_sim/player.h"

enum { HIL_BLOCK = 8 /**< runs that go along together */ };

/**
 * Run the seeds first_seed ... first_seed + count - 1, HIL_BLOCK at a time. Takes about 0.2 MB while it works. A run
 * that ends with a status other than HIL_RUN_OK has NaN for its figures, 0 for `completed`.
 * @param rows out, `count` rows in the order of their seeds. @param cancel looked at every HIL_LOOK_TICKS; not 0: stop.
 * May be NULL.
 * @return rows that are there: `count` unless it was cancelled; -1: out of memory.
 */
int64_t hil_batch_run(const hil_scenario_t *scenario, uint64_t first_seed, uint32_t count, hil_figures_t *rows,
                      const volatile int32_t *cancel);

#endif
