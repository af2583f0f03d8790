/* SPDX-License-Identifier: MIT */
/**
 * @file real.h
 * The number that the world is computed in. What is compiled a second time for eight runs at once (lanes) uses this type for
 * everything that may differ between runs, and hil_select where data decide; everything else is one value for all of them.
 */
#ifndef HIL_SIM_REAL_H
#define HIL_SIM_REAL_H

#ifndef hil_select /* the build for lanes brings its own type and its own blend */
typedef double hil_real_t;
#define hil_select(condition, a, b) ((condition) ? (a) : (b))
#endif

#endif
