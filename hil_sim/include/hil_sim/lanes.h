/* SPDX-License-Identifier: MIT */
/**
 * @file lanes.h
 * Eight runs at once: world, robot and figures in the lanes of vectors, the same bits as one by one.
 */
#ifndef HIL_SIM_LANES_H
#define HIL_SIM_LANES_H

#include "hil_sim/run.h"

/**
 * As hil_run_advance for each of eight runs, bit for bit. They share one flow of control; where their data would part
 * it, each goes on by itself for some ticks. Fewer than eight: the first again and again after the last.
 * @return `ticks`; 0, nothing done, if the runs differ at the start in more than numbers (states, faults, wheels, times
 * ...), record, or find no memory.
 */
uint64_t hil_lanes_advance(hil_run_t *const runs[8], uint64_t ticks);

/** What came of it; ticks are those of one run. */
typedef struct hil_lanes_stats_t {
    uint64_t together; /**< ticks done in lanes, each of them for eight runs */
    uint64_t again;    /**< ticks in lanes that were thrown away or done twice */
    uint64_t alone;    /**< ticks done run by run, each of them for eight runs */
    uint64_t parted;   /**< times that the lanes parted */
    uint64_t packed;   /**< times that runs were put into lanes */
    uint64_t refused;  /**< times that they could not be */
} hil_lanes_stats_t;

/** What to use: HIL_LANES_BEST of this processor unless said otherwise, for tests and benchmarks; of the whole process.
 */
typedef enum hil_lanes_level_t {
    HIL_LANES_NONE = 0, /**< hil_lanes_advance does nothing */
    HIL_LANES_BASELINE, /**< what every processor of this kind has */
    HIL_LANES_AVX2,     /**< with AVX2 at most, on x86-64 */
    HIL_LANES_BEST      /**< with AVX-512, too */
} hil_lanes_level_t;

void hil_lanes_use(hil_lanes_level_t level);

/** Whether HIL_LANES_AVX2 is more than HIL_LANES_BASELINE here. */
bool hil_lanes_has_avx2(void);

/** Whether HIL_LANES_BEST is more than HIL_LANES_AVX2 here. */
bool hil_lanes_has_avx512(void);

/** Of the calling thread since its last call of this. */
void hil_lanes_take_stats(hil_lanes_stats_t *stats);

#endif
