/* SPDX-License-Identifier: MIT */
/* External definitions of the inline functions. */
#define OMNI_INLINE
#include "math_inline.h"

static const omni_real_t largest_angle = 1e6f;
static const omni_real_t half_pi = 1.57079632679489661923f;

/*
 * pi/2 = c1 + c2 + c3 + c4 (Cody and Waite). c1, c2 and c3 have at most five significant bits. So their products with
 * the up to 20 bits of a quotient are exact, and so are the subtractions. Only the last one rounds.
 */
static const omni_real_t c1 = 1.5625f;              /* 25 / 2^4 */
static const omni_real_t c2 = 8.30078125e-3f;       /* 17 / 2^11 */
static const omni_real_t c3 = -4.5299530029297e-6f; /* -19 / 2^22 */
static const omni_real_t c4 = 7.5497899548918821e-8f;

/* Nearest whole number, halves to the even one. |value| < 2^22: next to 1.5 * 2^23 a float has no fraction. */
static omni_real_t nearest_whole(omni_real_t value) {
    const omni_real_t without_fraction = 12582912.0f;
    return (value + without_fraction) - without_fraction;
}

/* angle - quotient * pi/2. */
static omni_real_t minus_quarters(omni_real_t angle, omni_real_t quotient) {
    return ((angle - quotient * c1) - quotient * c2) - quotient * c3 - quotient * c4;
}

/* An angle that can be reduced: NaN stays NaN, infinities become NaN, angles beyond the range 0. */
static omni_real_t usable_angle(omni_real_t angle) {
    if (!omni_is_finite(angle)) {
        return 0.0f * angle;
    }
    return omni_select(OMNI_FABSF(angle) <= largest_angle, angle, 0.0f);
}

/* Minimax polynomials over |x| <= 0.79, error 2e-9. */
static omni_real_t sine_polynomial(omni_real_t x) {
    const omni_real_t z = x * x;
    return x + x * z * (-0.16666651f + z * (0.008331947f + z * -0.00019491608f));
}

static omni_real_t cosine_polynomial(omni_real_t x) {
    const omni_real_t z = x * x;
    return 1.0f - 0.5f * z + z * z * (0.041666646f + z * (-0.0013887332f + z * 2.4434214e-05f));
}

/* Minimax polynomial over |x| <= tan(pi/8), error 5e-9. */
static omni_real_t arctangent_polynomial(omni_real_t x) {
    const omni_real_t z = x * x;
    return x + x * z * (-0.33332756f + z * (0.19971879f + z * (-0.13824452f + z * 0.07902596f)));
}

void omni_sincosf(omni_real_t angle, omni_real_t *sine, omni_real_t *cosine) {
    if (!(OMNI_FABSF(angle) <= largest_angle)) {
        const omni_real_t x = usable_angle(angle); /* 0, or NaN */
        *sine = x;
        *cosine = 1.0f + x;
        return;
    }
    const omni_real_t quarters = nearest_whole(angle * 0.636619772f);
    const omni_real_t rest = minus_quarters(angle, quarters);
    const omni_real_t s = sine_polynomial(rest);
    const omni_real_t c = cosine_polynomial(rest);
    const omni_uint_t quadrant = (omni_uint_t)(omni_int_t)quarters & 3u;
    const omni_real_t swapped_s = omni_select((quadrant & 1u) != 0u, c, s);
    const omni_real_t swapped_c = omni_select((quadrant & 1u) != 0u, s, c);
    *sine = omni_select((quadrant & 2u) != 0u, -swapped_s, swapped_s);
    *cosine = omni_select(quadrant == 1u || quadrant == 2u, -swapped_c, swapped_c);
}

omni_real_t omni_atan2f(omni_real_t y, omni_real_t x) {
    const omni_real_t ax = OMNI_FABSF(x);
    const omni_real_t ay = OMNI_FABSF(y);
    if (!omni_is_finite(ax) || !omni_is_finite(ay)) {
        return 0.0f * ax + 0.0f * ay; /* NaN */
    }
    const omni_real_t low = omni_minf(ax, ay);
    const omni_real_t high = omni_maxf(ay, ax);
    if (high == 0.0f) {
        return 0.0f;
    }
    const omni_real_t ratio = low / high;
    const omni_flag_t steep = ratio > 0.41421356f;
    const omni_real_t reduced = omni_select(steep, (ratio - 1.0f) / (ratio + 1.0f), ratio);
    const omni_real_t octant = arctangent_polynomial(reduced) + omni_select(steep, 0.5f * half_pi, 0.0f);
    const omni_real_t quadrant = omni_select(ax < ay, half_pi - octant, octant);
    const omni_real_t half_plane = omni_select(x < 0.0f, OMNI_PI_F - quadrant, quadrant);
    return omni_select(y < 0.0f, -half_plane, half_plane);
}

omni_real_t omni_wrap_pi(omni_real_t angle) {
    if (omni_all(omni_absf(angle) < 3.0f)) {
        return angle + 0.0f; /* -0 gives 0, as below */
    }
    const omni_real_t x = usable_angle(angle);
    if (!omni_is_finite(x)) {
        return x;
    }
    const omni_real_t turns = nearest_whole(x * 0.159154943f);
    const omni_real_t wrapped = minus_quarters(x, 4.0f * turns);
    const omni_real_t raised = omni_select(wrapped < -OMNI_PI_F, wrapped + 2.0f * OMNI_PI_F, wrapped);
    return omni_select(wrapped >= OMNI_PI_F, wrapped - 2.0f * OMNI_PI_F, raised);
}
