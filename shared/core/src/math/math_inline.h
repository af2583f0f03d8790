/* SPDX-License-Identifier: MIT */
/**
 * @file math_inline.h
 * Inline bodies of the small functions of omni/math.h, for the core's sources. Why: calls would cost a fifth of the
 * tick. math.c includes this with OMNI_INLINE empty and so provides the external definitions. Not part of the API.
 */
#ifndef OMNI_MATH_INLINE_H
#define OMNI_MATH_INLINE_H

#include "omni/math.h"

#ifndef OMNI_INLINE
/* gnu_inline: inline only, emits no external definition. */
#define OMNI_INLINE extern inline __attribute__((gnu_inline, always_inline))
#endif

OMNI_INLINE omni_real_t omni_sqrtf(omni_real_t value) {
    return omni_select(value > 0.0f, OMNI_SQRTF(value), 0.0f);
}

OMNI_INLINE omni_real_t omni_maxf(omni_real_t a, omni_real_t b) {
    return omni_select(a > b, a, b);
}

OMNI_INLINE omni_real_t omni_minf(omni_real_t a, omni_real_t b) {
    return omni_select(a < b, a, b);
}

OMNI_INLINE omni_real_t omni_clampf(omni_real_t value, omni_real_t low, omni_real_t high) {
    return omni_minf(omni_maxf(value, low), high);
}

OMNI_INLINE omni_real_t omni_absf(omni_real_t value) {
    return OMNI_FABSF(value);
}

OMNI_INLINE omni_real_t omni_signf(omni_real_t value) {
    return omni_select(value > 0.0f, 1.0f, 0.0f) - omni_select(value < 0.0f, 1.0f, 0.0f);
}

OMNI_INLINE bool omni_is_finite(omni_real_t value) {
    const omni_real_t largest_finite = 3.402823466e38f;
    return OMNI_FABSF(value) <= largest_finite;
}

/* Are all `count` values finite? x - x is 0, or NaN for a NaN or an infinity. */
static inline bool omni_all_finite(const omni_real_t *values, int count) {
    omni_real_t sum = 0.0f;
    for (int i = 0; i < count; ++i) {
        sum += values[i] - values[i];
    }
    return sum == 0.0f;
}

OMNI_INLINE bool omni_pose_is_finite(const omni_pose_t *pose) {
    /* x - x is 0, or NaN for a NaN or an infinity. */
    return (pose->x - pose->x) + (pose->y - pose->y) + (pose->theta - pose->theta) == 0.0f;
}

OMNI_INLINE bool omni_twist_is_finite(const omni_twist_t *twist) {
    return (twist->vx - twist->vx) + (twist->vy - twist->vy) + (twist->wz - twist->wz) == 0.0f;
}

/* Are a pose and a twist both finite? One comparison for the two. */
static inline bool omni_motion_is_finite(const omni_pose_t *pose, const omni_twist_t *twist) {
    return ((pose->x - pose->x) + (pose->y - pose->y) + (pose->theta - pose->theta)) +
               ((twist->vx - twist->vx) + (twist->vy - twist->vy) + (twist->wz - twist->wz)) ==
           0.0f;
}

#endif
