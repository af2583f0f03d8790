/* SPDX-License-Identifier: MIT */
/* The functions of hil_sim/src that are not in the API, over arrays. */
#include <stddef.h>

#include "normal.h"
#include "wide_math.h"

void minus_log(size_t count, const uint32_t *word, float *out);
void normal_pairs(size_t count, const uint32_t *word, float *out);
void wide_sincos(size_t count, const double *angle, double *sine, double *cosine);
void wide_wrap(size_t count, const double *angle, double *out);

void minus_log(size_t count, const uint32_t *word, float *out) {
    for (size_t i = 0; i < count; ++i) {
        out[i] = hil_minus_log(word[i]);
    }
}

void normal_pairs(size_t count, const uint32_t *word, float *out) {
    for (size_t i = 0; i < 2 * count; i += 2) {
        hil_normal_pair(word[i], word[i + 1], &out[i]);
    }
}

void wide_sincos(size_t count, const double *angle, double *sine, double *cosine) {
    for (size_t i = 0; i < count; ++i) {
        hil_sincos(angle[i], &sine[i], &cosine[i]);
    }
}

void wide_wrap(size_t count, const double *angle, double *out) {
    for (size_t i = 0; i < count; ++i) {
        out[i] = hil_wrap(angle[i]);
    }
}
