/* SPDX-License-Identifier: MIT */
/** @file real.h  The numbers of the simulated world: whatever can differ between two runs of a study that share one flow of control. */
#ifndef HIL_SIM_REAL_H
#define HIL_SIM_REAL_H

#include <stdint.h>

typedef double hil_real_t;
typedef int32_t hil_int_t; /**< counters */

#endif
