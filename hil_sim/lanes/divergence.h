/* SPDX-License-Identifier: MIT */
/**
 * @file divergence.h
 * Eight runs in lanes share one flow of control. Where they would part, a flag of the thread is set and the flow
 * follows lane 0. What was computed since the flag was last taken is then worthless. It must be done again, run by run.
 */
#ifndef HIL_LANES_DIVERGENCE_H
#define HIL_LANES_DIVERGENCE_H

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

/** The lanes part here. */
__attribute__((cold, noinline)) void hil_lanes_part(void);

/** Have they parted since the last call? Clears the flag. */
bool hil_lanes_take_parted(void);

#ifdef __cplusplus
}
#endif

#endif
