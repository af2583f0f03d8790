/* SPDX-License-Identifier: MIT */
/**
 * @file real.h
 * Scalar types of the world. Code that is compiled a second time for SIMD lanes uses them for values that may differ
 * between runs, with hil_select for data-dependent choices; everything else is common to all lanes.
 */
#ifndef HIL_SIM_REAL_H
#define HIL_SIM_REAL_H

#include <stdbool.h>
#include <stdint.h>

#ifndef HIL_OWN_NUMBERS
typedef double hil_real_t;
typedef int32_t hil_int_t;    /**< counters */
typedef uint16_t hil_steps_t; /**< of a PWM period */
typedef bool hil_flag_t;
typedef uint64_t hil_time_t; /**< microseconds or ticks */
typedef uint64_t hil_seed_t; /**< of the random numbers */
#define hil_select(condition, a, b) ((condition) ? (a) : (b))
#endif

#endif
