/* SPDX-License-Identifier: MIT */
#include "divergence.h"

#ifdef HIL_LANES_TRACE
#include <stdio.h>
#endif

static __thread bool parted;

void hil_lanes_diverge(void) {
#ifdef HIL_LANES_TRACE
    /* For addr2line -i: which condition it was. */
    (void)fprintf(stderr, "lanes part at %p\n", __builtin_return_address(0));
#endif
    parted = true;
}

bool hil_lanes_take_diverged(void) {
    const bool before = parted;
    parted = false;
    return before;
}
