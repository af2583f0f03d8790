/* SPDX-License-Identifier: MIT */
/** @file random.h  Seeded random numbers (splitmix64) that are the same on every machine: integers and exact float
 * steps only. */
#ifndef PARITY_RANDOM_H
#define PARITY_RANDOM_H

#include "omni/types.h"

typedef struct random_t {
    uint64_t state;
} random_t;

uint32_t random_u32(random_t *random);

/** 0..count - 1; count > 0. */
uint32_t random_below(random_t *random, uint32_t count);

/** True with a probability of per_million in a million. */
bool random_chance(random_t *random, uint32_t per_million);

/** low..high. */
omni_real_t random_between(random_t *random, omni_real_t low, omni_real_t high);

/** Mean 0, standard deviation about 1, within -3.5..3.5. */
omni_real_t random_normal(random_t *random);

#endif
