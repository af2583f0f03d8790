/* SPDX-License-Identifier: MIT */
/**
 * @file real.h
 * The numbers that the world is computed in. What is compiled a second time for eight runs at once (lanes) uses these
 * types for everything that may differ between runs. Where data decide it uses hil_select. Everything else is one value
 * for all of them.
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
