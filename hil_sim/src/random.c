/* SPDX-License-Identifier: MIT */
#include "hil_sim/random.h"

#include <math.h>

static const double TWO_PI = 6.28318530717958647692;

enum { ROUNDS = 10, KIND_UNIFORM = 0, KIND_NORMAL = 1, KIND_NORMAL4 = 2 };

void hil_philox(const uint32_t *key, const uint32_t *counter, uint32_t *out) {
    uint32_t c0 = counter[0], c1 = counter[1], c2 = counter[2], c3 = counter[3];
    uint32_t k0 = key[0], k1 = key[1];
    for (int round = 0; round < ROUNDS; round++) {
        const uint64_t p0 = (uint64_t)0xD2511F53u * c0;
        const uint64_t p1 = (uint64_t)0xCD9E8D57u * c2;
        c0 = (uint32_t)(p1 >> 32) ^ c1 ^ k0;
        c1 = (uint32_t)p1;
        c2 = (uint32_t)(p0 >> 32) ^ c3 ^ k1;
        c3 = (uint32_t)p0;
        k0 += 0x9E3779B9u;
        k1 += 0xBB67AE85u;
    }
    out[0] = c0;
    out[1] = c1;
    out[2] = c2;
    out[3] = c3;
}

static void draw(uint64_t seed, uint32_t stream, uint64_t index, uint32_t kind, uint32_t *out) {
    const uint32_t key[2] = {(uint32_t)seed, (uint32_t)(seed >> 32)};
    const uint32_t counter[4] = {(uint32_t)index, (uint32_t)(index >> 32), stream, kind};
    hil_philox(key, counter, out);
}

/* 53 bits, the whole significand of a double. */
static double unit_interval(uint32_t low, uint32_t high) {
    const uint64_t bits = ((uint64_t)high << 32 | low) >> 11;
    return (double)bits * 0x1p-53;
}

double hil_uniform(uint64_t seed, uint32_t stream, uint64_t index) {
    uint32_t word[4];
    draw(seed, stream, index, KIND_UNIFORM, word);
    return unit_interval(word[0], word[1]);
}

double hil_normal(uint64_t seed, uint32_t stream, uint64_t index) {
    uint32_t word[4];
    draw(seed, stream, index, KIND_NORMAL, word);
    const double radius = sqrt(-2.0 * log(1.0 - unit_interval(word[0], word[1])));
    return radius * cos(TWO_PI * unit_interval(word[2], word[3]));
}

/* The middle of one of 2^32 cells of (0, 1): 32 bits, and never 0. */
static double cell_middle(uint32_t word) {
    return ((double)word + 0.5) * 0x1p-32;
}

void hil_normal4(uint64_t seed, uint32_t stream, uint64_t index, double *out) {
    uint32_t word[4];
    draw(seed, stream, index, KIND_NORMAL4, word);
    for (int pair = 0; pair < 4; pair += 2) {
        const double radius = sqrt(-2.0 * log(cell_middle(word[pair])));
        const double angle = TWO_PI * cell_middle(word[pair + 1]);
        out[pair] = radius * cos(angle);
        out[pair + 1] = radius * sin(angle);
    }
}
