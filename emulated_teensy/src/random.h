/* SPDX-License-Identifier: MIT */
/**
 * @file random.h
 * Random numbers that are a function of seed, stream and index: SplitMix64 (Steele, Lea, Flood 2014) of the three.
 */
#ifndef EMULATED_TEENSY_RANDOM_H
#define EMULATED_TEENSY_RANDOM_H

#include <stdint.h>

static inline uint64_t rt_mix(uint64_t x) {
    x += 0x9E3779B97F4A7C15u;
    x = (x ^ x >> 30) * 0xBF58476D1CE4E5B9u;
    x = (x ^ x >> 27) * 0x94D049BB133111EBu;
    return x ^ x >> 31;
}

/** Uniform in [0, 1). */
static inline double rt_uniform(uint64_t seed, uint32_t stream, uint64_t index) {
    return (double)(rt_mix(rt_mix(rt_mix(seed) ^ stream) ^ index) >> 11) * 0x1p-53;
}

#endif
