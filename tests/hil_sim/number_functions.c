/* SPDX-License-Identifier: MIT */
/* The functions of hil_sim/src that are not in the API, over arrays. */
#include <stddef.h>

#include "normal.h"
#include "real_math.h"

void minus_log(size_t count, const uint32_t *word, float *out);
void normal_pairs(size_t count, const uint32_t *word, float *out);
void real_cos_sin(size_t count, const double *angle, double *out);
void real_wrap(size_t count, const double *angle, double *out);

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

void real_cos_sin(size_t count, const double *angle, double *out) {
    for (size_t i = 0; i < count; ++i) {
        hil_cos_sin(angle[i], &out[2 * i]);
    }
}

void real_wrap(size_t count, const double *angle, double *out) {
    for (size_t i = 0; i < count; ++i) {
        out[i] = hil_wrap(angle[i]);
    }
}
