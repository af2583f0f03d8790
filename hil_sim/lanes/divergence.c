/* SPDX-License-Identifier: MIT */
#include "divergence.h"

static __thread bool parted;

void hil_lanes_part(void) {
    parted = true;
}

bool hil_lanes_take_parted(void) {
    const bool before = parted;
    parted = false;
    return before;
}
