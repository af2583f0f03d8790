/* SPDX-License-Identifier: MIT */
/**
 * @file batch.h
 * Monte Carlo: many runs of a scenario in one call, with a row of figures each and no records. A row is a pure function
 * of scenario and seed, independent of batch size and threads.
 */
#ifndef HIL_SIM_BATCH_H
#define HIL_SIM_BATCH_H

#include "hil_sim/figures.h"
#include "hil_sim/player.h"

enum { HIL_BLOCK = 8 /**< runs computed together */ };

/**
 * Run the seeds first_seed ... first_seed + count - 1, HIL_BLOCK at a time. Uses about 0.2 MB. A run
 * that ends with a status other than HIL_RUN_OK has NaN for its figures, 0 for `completed`.
 * @param rows out, `count` rows in the order of their seeds. @param cancel checked every HIL_UPDATE_TICKS; not 0 aborts
 * the batch. May be NULL.
 * @return number of valid rows: `count` unless cancelled; -1: out of memory.
 */
int64_t hil_batch_run(const hil_scenario_t *scenario, uint64_t first_seed, uint32_t count, hil_figures_t *rows,
                      const volatile int32_t *cancel);

#endif
