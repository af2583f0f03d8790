/* SPDX-License-Identifier: MIT */
/** @file layout_headers.h  The headers that make_layout.py reads. */
#ifndef HIL_LANES_LAYOUT_HEADERS_H
#define HIL_LANES_LAYOUT_HEADERS_H

#include "hil_sim/metrics.h"
#include "hil_sim/world.h"
#include "omni/robot.h"

#endif
