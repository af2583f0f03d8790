/* SPDX-License-Identifier: MIT */
#include "omni/saturation.h"

#include "../math/math_inline.h"

static omni_real_t refuse_values(omni_real_t *values, uint8_t count) {
    for (uint8_t i = 0; i < count; i++) {
        values[i] = 0.0f;
    }
    return 0.0f;
}

omni_real_t omni_saturate_direction(omni_real_t *values, uint8_t count, omni_real_t limit) {
    omni_real_t peak = 0.0f;
    for (uint8_t i = 0; i < count; i++) {
        const omni_real_t magnitude = omni_absf(values[i]);
        peak = omni_maxf(magnitude, peak);
    }
    if (!(limit > 0.0f) || !omni_all_finite(values, count)) {
        return refuse_values(values, count);
    }
    if (omni_all(peak <= limit)) {
        return 1.0f;
    }
    /* [report eq. 30]: all are scaled by limit / absmax */
    const omni_real_t factor = omni_select(peak <= limit, 1.0f, limit / peak);
    for (uint8_t i = 0; i < count; i++) {
        /* rounding may have put the largest a bit beyond the limit */
        values[i] = omni_clampf(values[i] * factor, -limit, limit);
    }
    return factor;
}
