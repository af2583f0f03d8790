/* SPDX-License-Identifier: MIT */
/**
 * @file math.h
 * Replacement for libm. Why: only IEEE-exact operations are used (+ - * / sqrt, integer
 * conversion), so x86-64 and Cortex-M7 give identical bits.
 */
#ifndef OMNI_MATH_H
#define OMNI_MATH_H

#include "omni/types.h"

/** pi rounded to binary32. */
#define OMNI_PI_F 3.14159265358979323846f

/**
 * Sine and cosine together. @param angle [rad], |angle| <= 1e6: error <= 2e-7 absolute. Beyond that range neighbouring
 * floats are too far apart for an angle, and the result is that of angle 0. A NaN or an infinity gives NaN in both.
 */
void omni_sincosf(omni_real_t angle, omni_real_t *sine, omni_real_t *cosine);

/** Four-quadrant arc tangent [rad], -pi..pi, absolute error <= 5e-7; (0, 0) gives 0; a NaN or an infinity gives NaN. */
omni_real_t omni_atan2f(omni_real_t y, omni_real_t x);

/** Angle wrapped into [-pi, pi), error <= 5e-7 absolute. @param angle [rad], |angle| <= 1e6; beyond 0. A NaN or an
 * infinity gives NaN. */
omni_real_t omni_wrap_pi(omni_real_t angle);

/** Square root, IEEE-exact; a negative argument gives 0 (never NaN in a control path). */
omni_real_t omni_sqrtf(omni_real_t value);

/** Larger and smaller of two values; b if a is NaN. */
omni_real_t omni_maxf(omni_real_t a, omni_real_t b);
omni_real_t omni_minf(omni_real_t a, omni_real_t b);

/** Value limited to [low, high]; a NaN gives low. */
omni_real_t omni_clampf(omni_real_t value, omni_real_t low, omni_real_t high);

/** |value|. */
omni_real_t omni_absf(omni_real_t value);

/** -1, 0 or 1; a NaN gives 0. */
omni_real_t omni_signf(omni_real_t value);

/** False for NaN and infinities. */
bool omni_is_finite(omni_real_t value);

/** True if all three components are finite. */
bool omni_pose_is_finite(const omni_pose_t *pose);
bool omni_twist_is_finite(const omni_twist_t *twist);

#endif
