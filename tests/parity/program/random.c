/* SPDX-License-Identifier: MIT */
#include "random.h"

uint32_t random_u32(random_t *random) {
    random->state += 0x9E3779B97F4A7C15u;
    uint64_t z = random->state;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return (uint32_t)(z >> 32);
}

uint32_t random_below(random_t *random, uint32_t count) {
    return (uint32_t)(((uint64_t)random_u32(random) * count) >> 32);
}

bool random_chance(random_t *random, uint32_t per_million) {
    return random_below(random, 1000000u) < per_million;
}

omni_real_t random_between(random_t *random, omni_real_t low, omni_real_t high) {
    const omni_real_t unit = (omni_real_t)(random_u32(random) >> 8) * (1.0f / 16777216.0f);
    return low + unit * (high - low);
}

omni_real_t random_normal(random_t *random) {
    omni_real_t sum = 0.0f;
    for (int i = 0; i < 4; ++i) {
        sum += random_between(random, -1.0f, 1.0f);
    }
    return sum * 0.8660254f;
}
