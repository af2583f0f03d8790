/* SPDX-License-Identifier: MIT
 * Everything that Python sees of the C code: the public headers of the control core and of the simulated world. */
#include "hil_sim/hil_sim.h"
#include "hil_sim/rt1062.h"
#include "omni/omni.h"
