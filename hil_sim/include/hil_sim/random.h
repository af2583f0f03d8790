/* SPDX-License-Identifier: MIT */
/**
 * @file random.h
 * Counter-based random numbers (Philox4x32-10, Salmon et al. 2011): a number is a pure function of (seed, stream,
 * index), so that results do not depend on threads, batch sizes or the order of draws.
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
 * Independent standard normals for loops that draw many, four per Philox block: single precision, no libm, the same
 * bits on every machine. A pair (R cos a, R sin a) is within 4e-7 R of the exact one. R <= 6.77, which cuts off
 * 1.3e-11 of a normal distribution.
 * @param index  of the first block. @param out  4 blocks.
 */
void hil_normals(uint64_t seed, uint32_t stream, uint64_t index, uint32_t blocks, float *out);

#endif
