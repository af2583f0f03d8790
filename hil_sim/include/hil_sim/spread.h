/* SPDX-License-Identifier: MIT */
/**
 * @file spread.h
 * Online mean, variance (Welford 1962, merged by Chan et al. 1979) and extremes. IEEE operations in a fixed order:
 * bit-identical on every machine for the same values, order and partition.
 */
#ifndef HIL_SIM_SPREAD_H
#define HIL_SIM_SPREAD_H

#include <stdint.h>

/** All zero: no values yet. */
typedef struct hil_spread_t {
    uint64_t count;   /**< finite values */
    uint64_t missing; /**< values that are not a number or infinite */
    double mean;      /**< of the finite ones, like everything below */
    double m2;        /**< sum of the squares of the deviations from the mean */
    double min;
    double max;
} hil_spread_t;

/** Add `count` values, the first one at `values`, `stride` bytes apart. */
void hil_spread_add(hil_spread_t *spread, const double *values, uint32_t stride, uint32_t count);

/** Merge another spread, whose values follow those of `spread`. */
void hil_spread_merge(hil_spread_t *spread, const hil_spread_t *other);

#endif
