/* SPDX-License-Identifier: MIT */
/**
 * @file random.h
 * Counter-based random numbers (Philox4x32-10, Salmon et al. 2011): a number is a pure function of (seed, stream, index), so runs
 * do not depend on threads, batch sizes or the order of draws.
 */
#ifndef HIL_SIM_RANDOM_H
#define HIL_SIM_RANDOM_H

#include <stdint.h>

/** Four 32-bit words of Philox4x32-10. @param key 2 words, @param counter 4 words, @param out 4 words. */
void hil_philox(const uint32_t *key, const uint32_t *counter, uint32_t *out);

/** Uniform in [0, 1). */
double hil_uniform(uint64_t seed, uint32_t stream, uint64_t index);

/** Standard normal (Box-Muller). */
double hil_normal(uint64_t seed, uint32_t stream, uint64_t index);

/**
 * Four independent standard normals from one Philox block, for loops that draw many: single precision (within 4e-7 times the larger of
 * 1 and a pair's distance from 0), no libm, |normal| <= 6.77; the same bits on every machine.
 */
void hil_normal4(uint64_t seed, uint32_t stream, uint64_t index, float *out);

#endif
