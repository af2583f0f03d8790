/* SPDX-License-Identifier: MIT */
/** @file saturation.h  Limits that keep the direction of a wheel vector (eq. 30). */
#ifndef OMNI_SATURATION_H
#define OMNI_SATURATION_H

#include "omni/types.h"

/**
 * Scale all `count` values by one factor so that none exceeds `limit` in magnitude.
 * @return the factor, 0 < factor <= 1; 1 means nothing was cut. Values that aren't finite, or limit <= 0, zero them all
 *         and return 0.
 */
omni_real_t omni_saturate_direction(omni_real_t *values, uint8_t count, omni_real_t limit);

#endif
