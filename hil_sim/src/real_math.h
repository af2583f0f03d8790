/* SPDX-License-Identifier: MIT */
/** @file real_math.h  What the world computes with hil_real_t beyond + - * /; in a header because it is in the
 * innermost loop. */
#ifndef HIL_SIM_REAL_MATH_H
#define HIL_SIM_REAL_MATH_H

#include <math.h>

#include "hil_sim/real.h"

static const double HIL_PI = 3.14159265358979323846;

/** For functions that the loop over the wheels is unrolled in. */
#define HIL_INLINE static inline __attribute__((always_inline))

#ifndef HIL_OWN_NUMBERS
#define hil_sqrt sqrt
#define hil_abs fabs
#define hil_copysign copysign
#define hil_exp exp
#define hil_log1p log1p

/** A counter after `edges` more, a whole number; it wraps as a hardware counter does. */
HIL_INLINE hil_int_t hil_count_on(hil_int_t count, hil_real_t edges) {
    return (hil_int_t)((uint32_t)count + (uint32_t)(int64_t)edges);
}
#endif

/* Not fmax and fmin, which are calls. */
HIL_INLINE hil_real_t hil_max(hil_real_t a, hil_real_t b) {
    return hil_select(a > b, a, b);
}

HIL_INLINE hil_real_t hil_min(hil_real_t a, hil_real_t b) {
    return hil_select(a < b, a, b);
}

/** Nearest whole number, halves to even, of |x| < 2^51: above 2^52 a double has no places left for a fraction. */
HIL_INLINE hil_real_t hil_nearest(hil_real_t x) {
    const double no_fraction = 0x1.8p52;
    return (x + no_fraction) - no_fraction;
}

/** Largest whole number not above x, |x| < 2^51. */
HIL_INLINE hil_real_t hil_floor(hil_real_t x) {
    const hil_real_t whole = hil_nearest(x);
    return hil_select(whole > x, whole - 1.0, whole);
}

/**
 * Cosine and sine of an angle up to a million radians, to 4e-16. They come from the nearest quarter turn in three parts
 * (Cody and Waite), then Taylor's series on -pi/4..pi/4.
 */
HIL_INLINE void hil_cos_sin(hil_real_t angle_rad, hil_real_t *cos_sin) {
    static const double SIN_TAIL[6] = {1.0 / 6227020800.0, -1.0 / 39916800.0, 1.0 / 362880.0,
                                       -1.0 / 5040.0,      1.0 / 120.0,       -1.0 / 6.0};
    static const double COS_TAIL[6] = {-1.0 / 87178291200.0, 1.0 / 479001600.0, -1.0 / 3628800.0,
                                       1.0 / 40320.0,        -1.0 / 720.0,      1.0 / 24.0};
    const hil_real_t quarters = hil_nearest(angle_rad * (2.0 / HIL_PI));
    const hil_real_t x =
        ((angle_rad - quarters * 0x1.921fb544p0) - quarters * 0x1.0b4611a6p-34) - quarters * 0x1.3198a2e037073p-69;
    const hil_real_t x2 = x * x;
    hil_real_t sin_tail = -1.0 / 1307674368000.0;
    hil_real_t cos_tail = 1.0 / 20922789888000.0;
    for (int n = 0; n < 6; n++) {
        sin_tail = sin_tail * x2 + SIN_TAIL[n];
        cos_tail = cos_tail * x2 + COS_TAIL[n];
    }
    const hil_real_t s = x + x * (x2 * sin_tail);
    const hil_real_t c = (1.0 - 0.5 * x2) + x2 * x2 * cos_tail;
    const hil_real_t turn = quarters - 4.0 * hil_nearest(0.25 * quarters); /* -2..2 */
    const hil_real_t odd = turn * turn;                                    /* 1: a quarter turn, 4: a half, 0: none */
    cos_sin[0] = hil_select(odd == 1.0, hil_select(turn > 0.0, -s, s), hil_select(odd > 1.0, -c, c));
    cos_sin[1] = hil_select(odd == 1.0, hil_select(turn > 0.0, c, -c), hil_select(odd > 1.0, -s, s));
}

/** Angle wrapped into [-pi, pi], within 3e-16 for each turn taken away. */
HIL_INLINE hil_real_t hil_wrap(hil_real_t angle_rad) {
    return angle_rad - 2.0 * HIL_PI * hil_nearest(angle_rad * (0.5 / HIL_PI));
}

#endif
