/* SPDX-License-Identifier: MIT */
/* Any duty, a NaN too: both inputs' high times fit a PWM period, and a motor that is not to be driven coasts. */
#include "any.h"

void proof_bridge(void) {
    const omni_bridge_counts_t counts = omni_bridge_counts(any_real(), true);
    /*@ check within_a_period: counts.in1 <= OMNI_PWM_STEPS && counts.in2 <= OMNI_PWM_STEPS; */
    const omni_bridge_counts_t off = omni_bridge_counts(any_real(), false);
    /*@ check coasts: off.in1 == 0 && off.in2 == 0; */
}
