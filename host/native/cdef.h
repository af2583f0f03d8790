/* SPDX-License-Identifier: MIT
 * Everything that Python sees of the C code: the public headers of the control core and of the simulated world. */
#include "emulated_teensy/rt1062.h"
#include "hil_sim/hil_sim.h"
#include "hil_sim/teensy_circuit.h"
#include "omni/omni.h"
