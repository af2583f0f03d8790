/* SPDX-License-Identifier: MIT */
/**
 * @file filter_study_vectors.h
 * Vectors for filter_study_simd.c, by the vector extensions of gcc and clang. A block of runs is a vector of floats.
 * Numbers of the study are floats, too (STUDY_SINGLE), or doubles in two vectors, one group of runs after the other.
 * The width is that of the processor that is compiled for; STUDY_BYTES overrules it.
 */
#ifndef FILTER_STUDY_VECTORS_H
#define FILTER_STUDY_VECTORS_H

#include <stdint.h>
#include <string.h>

#if defined(__SSE2__)
#include <immintrin.h>
#elif defined(__ARM_NEON) && defined(__aarch64__)
#include <arm_neon.h>
#else
#include <math.h>
#endif

#ifndef STUDY_BYTES
#if defined(__AVX512F__)
#define STUDY_BYTES 64
#elif defined(__AVX2__)
#define STUDY_BYTES 32
#else
#define STUDY_BYTES 16 /* SSE2, NEON; elsewhere the compiler splits it up */
#endif
#endif

#ifdef STUDY_SINGLE
typedef float number_t;
typedef int32_t number_bits_t;
#define SIGN_BIT INT32_MIN
#else
typedef double number_t;
typedef int64_t number_bits_t;
#define SIGN_BIT INT64_MIN
#endif

enum {
    LANES = STUDY_BYTES / (int)sizeof(float),         /* runs of a block */
    WIDTH = STUDY_BYTES / (int)sizeof(number_t),      /* runs of a group: numbers in a vector */
    GROUPS = (int)(sizeof(number_t) / sizeof(float)), /* groups of a block */
};

#define STUDY_INLINE static inline __attribute__((always_inline))

typedef float floats_t __attribute__((vector_size(STUDY_BYTES)));
typedef int32_t ints_t __attribute__((vector_size(STUDY_BYTES)));
typedef uint32_t words_t __attribute__((vector_size(STUDY_BYTES)));
typedef number_t numbers_t __attribute__((vector_size(STUDY_BYTES)));
typedef number_bits_t number_bits_v __attribute__((vector_size(STUDY_BYTES)));

STUDY_INLINE floats_t to_floats(ints_t a) {
    return __builtin_convertvector(a, floats_t);
}

STUDY_INLINE floats_t float_root(floats_t a) {
#if defined(__AVX512F__) && STUDY_BYTES == 64
    return (floats_t)_mm512_sqrt_ps((__m512)a);
#elif defined(__AVX2__) && STUDY_BYTES == 32
    return (floats_t)_mm256_sqrt_ps((__m256)a);
#elif defined(__SSE2__) && STUDY_BYTES == 16
    return (floats_t)_mm_sqrt_ps((__m128)a);
#elif defined(__ARM_NEON) && defined(__aarch64__) && STUDY_BYTES == 16
    return (floats_t)vsqrtq_f32((float32x4_t)a);
#else
    for (int lane = 0; lane < LANES; lane++) {
        a[lane] = __builtin_sqrtf(a[lane]);
    }
    return a;
#endif
}

/** Numbers of `group` out of a block of floats in memory. */
STUDY_INLINE numbers_t group_of(const float *block, int group) {
#ifdef STUDY_SINGLE
    (void)group;
    numbers_t all;
    memcpy(&all, block, sizeof all);
    return all;
#else
    typedef float half_t __attribute__((vector_size(STUDY_BYTES / 2)));
    half_t half;
    memcpy(&half, block + group * WIDTH, sizeof half);
    return __builtin_convertvector(half, numbers_t);
#endif
}

STUDY_INLINE numbers_t all(number_t value) {
    const numbers_t none = {0};
    return none + value;
}

/** value * sign(a), and 0 where a is 0. */
STUDY_INLINE numbers_t with_sign_of(numbers_t a, number_t value) {
    const number_bits_v signed_bits = (number_bits_v)all(value) ^ ((number_bits_v)a & SIGN_BIT);
    return (numbers_t)(signed_bits & (number_bits_v)(a != (number_t)0));
}

#endif
