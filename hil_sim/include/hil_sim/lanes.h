/* SPDX-License-Identifier: MIT */
/**
 * @file lanes.h
 * SIMD lanes: eight runs at once (world, robot, metrics), bit-identical to single runs.
 */
#ifndef HIL_SIM_LANES_H
#define HIL_SIM_LANES_H

#include "hil_sim/run.h"

/**
 * hil_run_advance for eight runs, bit-identical. They share one control flow; where it would diverge, the runs are
 * advanced one by one for some ticks. For fewer than eight runs repeat the first one.
 * @return `ticks`; 0 (nothing done) if the runs differ at the start in more than numbers (states, faults, wheels, times
 * ...), have a record, or memory is short.
 */
uint64_t hil_lanes_advance(hil_run_t *const runs[8], uint64_t ticks);

/** Statistics; ticks are those of one run. */
typedef struct hil_lanes_stats_t {
    uint64_t lane_ticks;     /**< ticks in lanes, for eight runs each */
    uint64_t repeated_ticks; /**< ticks in lanes that were discarded or repeated */
    uint64_t scalar_ticks;   /**< ticks run by run, for eight runs each */
    uint64_t divergences;    /**< number of divergences */
    uint64_t packed;         /**< number of packings into lanes */
    uint64_t pack_failures;  /**< number of failed packings */
} hil_lanes_stats_t;

/** Instruction set, for tests and benchmarks; default HIL_LANES_BEST. */
typedef enum hil_lanes_level_t {
    HIL_LANES_NONE = 0, /**< hil_lanes_advance does nothing */
    HIL_LANES_BASELINE, /**< baseline of the architecture */
    HIL_LANES_AVX2,     /**< with AVX2 at most, on x86-64 */
    HIL_LANES_BEST      /**< with AVX-512, too */
} hil_lanes_level_t;

/** Set the instruction set of the whole process. */
void hil_lanes_set_level(hil_lanes_level_t level);

/** Is AVX2 available? */
bool hil_lanes_has_avx2(void);

/** Is AVX-512 available? */
bool hil_lanes_has_avx512(void);

/** Read and clear the statistics of the calling thread. */
void hil_lanes_take_stats(hil_lanes_stats_t *stats);

#endif
