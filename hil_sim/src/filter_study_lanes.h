/* SPDX-License-Identifier: MIT */
/** @file filter_study_lanes.h  Several seeds of the filter study at once: one function per CPU level, same bits. */
#ifndef HIL_SIM_FILTER_STUDY_LANES_H
#define HIL_SIM_FILTER_STUDY_LANES_H

#include <stdbool.h>
#include <stdint.h>

#include "hil_sim/filter_study.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { HIL_FILTER_LANES = 8, HIL_FILTER_MOST_LANES = 16 };

/** hil_filter_sums_t of filter_study_parts.h, which has other numbers in lanes. */
struct hil_filter_sums_t;

/**
 * Run as many seeds as there are lanes, of a setting within its ranges. @param sums out: by seed.
 * @return false: not possible (lanes part, no memory, wheels that the core refuses); run the seeds one by one.
 */
typedef bool hil_filter_lanes_t(const hil_filter_config_t *config, const double *reference, const double *rate,
                                const uint64_t *seeds, struct hil_filter_sums_t *sums);

hil_filter_lanes_t hil_filter_lanes_baseline;
#ifdef __x86_64__
hil_filter_lanes_t hil_filter_lanes_avx2;
hil_filter_lanes_t hil_filter_lanes_avx512;
#endif

#ifdef __cplusplus
}
#endif

#endif
