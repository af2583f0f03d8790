/* SPDX-License-Identifier: MIT */
#include "hil_sim/random.h"

#include <math.h>

#include "normal.h"

static const double TWO_PI = 6.28318530717958647692;

void hil_philox(const uint32_t *key, const uint32_t *counter, uint32_t *out) {
    hil_philox_words(key, counter, out);
}

static void draw(uint64_t seed, uint32_t stream, uint64_t index, uint32_t kind, uint32_t *out) {
    const uint32_t key[2] = {(uint32_t)seed, (uint32_t)(seed >> 32)};
    hil_draw(key, stream, index, kind, out);
}

/* 53 bits, the whole significand of a double. */
static double unit_interval(uint32_t low, uint32_t high) {
    const uint64_t bits = ((uint64_t)high << 32 | low) >> 11;
    return (double)bits * 0x1p-53;
}

double hil_uniform(uint64_t seed, uint32_t stream, uint64_t index) {
    uint32_t word[4];
    draw(seed, stream, index, HIL_KIND_UNIFORM, word);
    return unit_interval(word[0], word[1]);
}

double hil_normal(uint64_t seed, uint32_t stream, uint64_t index) {
    uint32_t word[4];
    draw(seed, stream, index, HIL_KIND_NORMAL, word);
    const double radius = sqrt(-2.0 * log(1.0 - unit_interval(word[0], word[1])));
    return radius * cos(TWO_PI * unit_interval(word[2], word[3]));
}

void hil_normals(uint64_t seed, uint32_t stream, uint64_t index, uint32_t blocks, float *out) {
    for (uint32_t block = 0; block < blocks; block++) {
        uint32_t word[4];
        draw(seed, stream, index + block, HIL_KIND_NORMALS, word);
        hil_normal_pair(word[0], word[1], &out[4 * (size_t)block]);
        hil_normal_pair(word[2], word[3], &out[4 * (size_t)block + 2]);
    }
}
