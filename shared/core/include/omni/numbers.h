/* SPDX-License-Identifier: MIT */
/**
 * @file numbers.h
 * The types of numbers that the control core computes with. They let the simulation compute eight runs at once
 * (hil_sim/lanes).
 *
 * The simulation compiles the core's sources a second time, with numbers of its own that hold eight values. What may
 * differ from run to run is one of these types. Everything else is common to the runs. The rules are one page:
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

/** For conditions that the data often decide. Both values may be evaluated: they have no side effects. */
#define omni_select(condition, a, b) ((condition) ? (a) : (b))

/** For short cuts: the condition holds in every run, or in one at least. What comes after must do without the short
 * cut, too. */
#define omni_all(condition) (condition)
#define omni_any(condition) (condition)

#define OMNI_FABSF __builtin_fabsf
#define OMNI_SQRTF __builtin_sqrtf

/** A whole number as the nearest float; omni_float_of in the source that uses it is how this is done fast. */
#define omni_real_of(whole) omni_float_of(whole)
#endif

#endif
