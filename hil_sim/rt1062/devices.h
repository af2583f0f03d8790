/* SPDX-License-Identifier: MIT */
/**
 * @file devices.h
 * The peripherals that there are. A new one: its declaration here, a line in the table of bus.c, its state in state.h.
 */
#ifndef HIL_SIM_RT1062_DEVICES_H
#define HIL_SIM_RT1062_DEVICES_H

#include "machine.h"

extern const rt_device_t rt_scs; /* scs.c */
extern const rt_device_t rt_dwt; /* dwt.c */

#endif
