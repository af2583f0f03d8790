/* SPDX-License-Identifier: MIT */
#include "hil_sim/dispersion.h"

#include <string.h>

#include "hil_sim/random.h"

static const double WIDEST = 3.0;

/* FNV-1a; the upper half of the streams, because the world's own ones are small numbers. */
uint32_t hil_dispersion_stream(const char *name) {
    uint32_t hash = UINT32_C(2166136261);
    for (const char *c = name; *c != '\0'; c++) {
        hash = (hash ^ (uint8_t)*c) * UINT32_C(16777619);
    }
    return hash | UINT32_C(0x80000000);
}

static double normal_within(uint64_t seed, uint32_t stream, uint32_t element) {
    for (uint64_t attempt = 0;; attempt++) {
        const double z = hil_normal(seed, stream, attempt << 32 | element);
        if (z >= -WIDEST && z <= WIDEST) {
            return z;
        }
    }
}

static double deviation_of(const hil_dispersion_t *d, uint64_t seed, uint32_t element) {
    return d->kind == HIL_DISPERSION_NORMAL ? d->a + d->b * normal_within(seed, d->stream, element)
                                            : d->a + (d->b - d->a) * hil_uniform(seed, d->stream, element);
}

void hil_apply_dispersion(hil_world_config_t *config, const hil_dispersion_t *dispersion, uint32_t count,
                          uint64_t seed) {
    for (const hil_dispersion_t *d = dispersion; d < dispersion + count; d++) {
        for (uint32_t element = 0; element < d->count; element++) {
            char *at = (char *)config + d->offset + element * sizeof(double);
            double value;
            memcpy(&value, at, sizeof value);
            const double deviation = deviation_of(d, seed, element);
            value = d->relative ? value * (1.0 + deviation) : value + deviation;
            memcpy(at, &value, sizeof value);
        }
    }
}
