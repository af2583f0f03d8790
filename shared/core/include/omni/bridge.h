/* SPDX-License-Identifier: MIT */
/**
 * @file bridge.h
 * Duty of an H-bridge with two PWM inputs (DRV8871) as 12-bit counts, in drive-brake mode. One input is held high,
 * the other is low for the fraction |duty| of the period. So the mean voltage is duty * supply. Both low: coast.
 */
#ifndef OMNI_BRIDGE_H
#define OMNI_BRIDGE_H

#include "omni/types.h"

enum { OMNI_PWM_STEPS = 4096 };

/** High time of IN1 and IN2 per PWM period, 0 (always low) .. OMNI_PWM_STEPS (always high). */
typedef struct omni_bridge_counts_t {
    omni_steps_t in1;
    omni_steps_t in2;
} omni_bridge_counts_t;

/**
 * @param duty -1..1 (clamped; NaN brakes); positive: IN1 high, current from OUT1 to OUT2.
 * @param drive false: both inputs low (coast). true and duty 0: both high (brake).
 */
omni_bridge_counts_t omni_bridge_counts(omni_real_t duty, bool drive);

#endif
