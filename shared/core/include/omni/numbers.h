/* SPDX-License-Identifier: MIT */
/**
 * @file numbers.h
 * Scalar types of the control core. Why: the simulation compiles the core a second time with SIMD types in their place,
 * and so computes eight runs at once (hil_sim/lanes).
 *
 * A value that may differ between these runs has one of these types. Everything else is common to them. Rules:
 * docs/how-to-add/lanes.md.
 */
#ifndef OMNI_NUMBERS_H
#define OMNI_NUMBERS_H

#include <stdbool.h>
#include <stdint.h>

#ifndef OMNI_OWN_NUMBERS
/** Scalar of the control core: IEEE-754 binary32 on every target. */
typedef float omni_real_t;

typedef int32_t omni_int_t;
typedef uint32_t omni_uint_t;
typedef uint64_t omni_ns_t;    /**< nanoseconds */
typedef uint16_t omni_steps_t; /**< of a PWM period */
typedef bool omni_flag_t;

/** condition ? a : b without a branch, per lane. Both values are evaluated and must have no side effects. */
#define omni_select(condition, a, b) ((condition) ? (a) : (b))

/** Does the condition hold in all lanes, or in any? For early exits only: the code after it must give the same result
 * without the exit. */
#define omni_all(condition) (condition)
#define omni_any(condition) (condition)

#define OMNI_FABSF __builtin_fabsf
#define OMNI_SQRTF __builtin_sqrtf

/** Nearest float of an unsigned integer; omni_float_of is the fast implementation. */
#define omni_real_of(whole) omni_float_of(whole)
#endif

#endif
