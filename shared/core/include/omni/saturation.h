/* SPDX-License-Identifier: MIT */
/**
 * @file saturation.h
 * A limit that keeps the direction of a wheel vector v: v * min(1, limit / max_i |v_i|) [report eq. 30]. Cutting each
 * wheel by itself would turn the robot away from where it was told to go.
 */
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
