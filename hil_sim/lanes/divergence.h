/* SPDX-License-Identifier: MIT */
/**
 * @file divergence.h Divergence of lanes: eight runs share one control flow. Where a condition differs between lanes, a
 * thread-local flag is set and control follows lane 0. Everything computed since the flag was last taken is then
 * invalid and must be repeated run by run.
 */
#ifndef HIL_LANES_DIVERGENCE_H
#define HIL_LANES_DIVERGENCE_H

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

/** Report a divergence. */
__attribute__((cold, noinline)) void hil_lanes_diverge(void);

/** Has a divergence been reported since the last call? Clears the flag. */
bool hil_lanes_take_diverged(void);

#ifdef __cplusplus
}
#endif

#endif
