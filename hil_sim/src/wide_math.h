/* SPDX-License-Identifier: MIT */
/**
 * @file wide_math.h
 * Sine, cosine and wrapping in double precision by IEEE operations only: the same bits on every machine, in C and in lanes, which libm
 * does not promise. |angle| <= 1e6 rad.
 */
#ifndef HIL_SIM_WIDE_MATH_H
#define HIL_SIM_WIDE_MATH_H

#include "numbers.h"

#define HIL_PI 3.14159265358979323846

/** Nearest whole number, halves to even; |value| < 2^51. */
static inline hil_real_t hil_nearest(hil_real_t value) {
    const double big = 0x1.8p52; /* from here on doubles are whole numbers, and adding rounds */
    return (value + big) - big;
}

/** Angle wrapped into [-pi, pi], error <= 1e-16 per turn taken away. */
static inline hil_real_t hil_wrap(hil_real_t angle) {
    return angle - 2.0 * HIL_PI * hil_nearest(angle * (0.5 / HIL_PI));
}

/** Sine and cosine, absolute error <= 3e-15 + 1e-16 |angle|. */
static inline void hil_sincos(hil_real_t angle, hil_real_t *sine, hil_real_t *cosine) {
    const double half_pi = 0x1.921fb544p0; /* the first 33 bits of pi / 2: its product with a quotient is exact */
    const double half_pi_rest = 6.077100506506192e-11;
    const hil_real_t quarters = hil_nearest(angle * (2.0 / HIL_PI));
    const hil_real_t x = (angle - quarters * half_pi) - quarters * half_pi_rest;
    const hil_real_t z = x * x;
    /* minimax over |x| <= pi / 4: errors 2.3e-15 and 1e-16 */
    const hil_real_t s_tail =
        -0.1666666666660604 +
        z * (0.008333333321921465 + z * (-0.0001984126236480448 + z * (2.7555098680187325e-06 + z * -2.4745443420112847e-08)));
    const hil_real_t c_tail =
        0.04166666666660296 +
        z * (-0.0013888888878348788 + z * (2.4801580998212162e-05 + z * (-2.755557107618807e-07 + z * 2.0647948156759975e-09)));
    const hil_real_t s = x + x * z * s_tail;
    const hil_real_t c = 1.0 - 0.5 * z + z * z * c_tail;
    /* quarters = 2 halves + odd; an odd number of halves turns the signs */
    const hil_real_t halves = hil_nearest(quarters * 0.5 - 0.25);
    const hil_real_t sign = 1.0 - 2.0 * (halves - 2.0 * hil_nearest(halves * 0.5 - 0.25));
    *sine = sign * omni_select(quarters != 2.0 * halves, c, s);
    *cosine = sign * omni_select(quarters != 2.0 * halves, -s, c);
}

#endif
