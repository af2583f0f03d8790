/* SPDX-License-Identifier: MIT */
/**
 * @file normal.h
 * Philox4x32-10 and standard normals from its words, in single precision by IEEE operations only. They give the same
 * bits on every machine, in C and in lanes.
 *
 * Box-Muller: R = sqrt(-2 ln u), normals R cos(a) and R sin(a). Here u is the middle of one of 2^32 cells of (0, 1), so
 * |normal| <= 6.77. Beyond that lie 1.3e-11 of a normal distribution. A normal is within 4e-7 R of the exact one for
 * the same words.
 */
#ifndef HIL_SIM_NORMAL_H
#define HIL_SIM_NORMAL_H

#include "numbers.h"

enum { HIL_PHILOX_ROUNDS = 10, HIL_KIND_UNIFORM = 0, HIL_KIND_NORMAL = 1, HIL_KIND_NORMALS = 2 };

/** @param key 2 words, @param counter 4 words, @param out 4 words. */
static inline void hil_philox_words(const omni_uint_t *key, const omni_uint_t *counter, omni_uint_t *out) {
    omni_uint_t c0 = counter[0], c1 = counter[1], c2 = counter[2], c3 = counter[3];
    omni_uint_t k0 = key[0], k1 = key[1];
    for (int round = 0; round < HIL_PHILOX_ROUNDS; round++) {
        omni_uint_t high0, low0, high1, low1;
        hil_product(0xD2511F53u, c0, &high0, &low0);
        hil_product(0xCD9E8D57u, c2, &high1, &low1);
        c0 = high1 ^ c1 ^ k0;
        c1 = low1;
        c2 = high0 ^ c3 ^ k1;
        c3 = low0;
        k0 += 0x9E3779B9u;
        k1 += 0xBB67AE85u;
    }
    out[0] = c0;
    out[1] = c1;
    out[2] = c2;
    out[3] = c3;
}

/* word + 1/2, rounded once. */
static inline omni_real_t hil_cell_middle(omni_uint_t word) {
    const omni_real_t high = (omni_real_t)(omni_int_t)(word >> 16);
    const omni_real_t low = (omni_real_t)(omni_int_t)(word & 0xFFFFu);
    return high * 65536.0f + (low + 0.5f);
}

/** -ln((word + 1/2) / 2^32), relative error <= 4e-7 all the way to 0 and to 22.9. */
static inline omni_real_t hil_minus_log(omni_uint_t word) {
    /* In the uppermost quarter u = 1 - w, and it is w that single precision can tell apart. Elsewhere u = m 2^-k, 3/4
     * <= m < 3/2. */
    const omni_uint_t mirrored = omni_select(word >= 0xC0000000u, word ^ 0xFFFFFFFFu, word);
    const omni_real_t middle = hil_cell_middle(mirrored);
    const omni_uint_t exponent = (hil_bits(middle) - 0x3EC00000u) >> 23; /* 0x3EC00000: 3/8 */
    const omni_real_t m = hil_of_bits(hil_bits(middle) - (exponent << 23) + 0x800000u);
    const omni_real_t f = omni_select(word >= 0xC0000000u, middle * -0x1p-32f, m - 1.0f);
    const omni_real_t k = omni_select(word >= 0xC0000000u, 0.0f, (omni_real_t)(33 - (omni_int_t)exponent));
    /* ln(1 + f) = 2 artanh(s); minimax over |s| <= 1/5, error 3e-9 */
    const omni_real_t s = f / (2.0f + f);
    const omni_real_t z = s * s;
    const omni_real_t log_m = (s + s) * (1.0f + z * (0.33333475f + z * (0.19978804f + z * 0.15182625f)));
    return k * 0.69314718f - log_m;
}

/** Two independent standard normals of two words. */
static inline void hil_normal_pair(omni_uint_t first, omni_uint_t second, omni_real_t *out) {
    const omni_real_t radius = OMNI_SQRTF(2.0f * hil_minus_log(first));
    /* 31 bits are an angle in (-pi/2, pi/2), the one left mirrors it. */
    const omni_real_t cells = (omni_real_t)(omni_int_t)(second << 1);
    const omni_real_t x = (cells + 1.0f) * 7.3145906e-10f; /* pi / 2^32 */
    const omni_real_t z = x * x;
    /* minimax over |x| <= pi / 2: errors 5e-9 and 4e-10 */
    const omni_real_t s_tail = -0.16666657f + z * (0.0083330173f + z * (-0.00019806615f + z * 2.6000547e-06f));
    const omni_real_t c_tail = 0.041666656f + z * (-0.0013888569f + z * (2.4769304e-05f + z * -2.6193815e-07f));
    const omni_real_t sine = x + x * z * s_tail;
    const omni_real_t cosine = (1.0f - 0.5f * z) + z * z * c_tail;
    out[0] = hil_of_bits(hil_bits(radius * cosine) ^ (second & 0x80000000u));
    out[1] = radius * sine;
}

/** Words of block (stream, index, kind) of a seed's two words. */
static inline void hil_draw(const omni_uint_t *seed, uint32_t stream, uint64_t index, uint32_t kind, omni_uint_t *out) {
    const omni_uint_t counter[4] = {(uint32_t)index, (uint32_t)(index >> 32), stream, kind};
    hil_philox_words(seed, counter, out);
}

#endif
