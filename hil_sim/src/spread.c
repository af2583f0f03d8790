/* SPDX-License-Identifier: MIT */
#include "hil_sim/spread.h"

#include <math.h>
#include <string.h>

static void add(hil_spread_t *s, double value) {
    if (!isfinite(value)) {
        s->missing++;
        return;
    }
    const double deviation = value - s->mean;
    s->min = s->count == 0 || value < s->min ? value : s->min;
    s->max = s->count == 0 || value > s->max ? value : s->max;
    s->count++;
    s->mean += deviation / (double)s->count;
    s->m2 += deviation * (value - s->mean);
}

void hil_spread_add(hil_spread_t *spread, const double *values, uint32_t stride, uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        double value;
        memcpy(&value, (const char *)values + (size_t)i * stride, sizeof value);
        add(spread, value);
    }
}

void hil_spread_merge(hil_spread_t *spread, const hil_spread_t *other) {
    const uint64_t missing = spread->missing + other->missing;
    if (other->count > 0 && spread->count == 0) {
        *spread = *other;
    } else if (other->count > 0) {
        const double n = (double)spread->count;
        const double m = (double)other->count;
        const double apart = other->mean - spread->mean;
        spread->mean += apart * (m / (n + m));
        spread->m2 += other->m2 + apart * apart * (n * m / (n + m));
        spread->min = other->min < spread->min ? other->min : spread->min;
        spread->max = other->max > spread->max ? other->max : spread->max;
        spread->count += other->count;
    }
    spread->missing = missing;
}
