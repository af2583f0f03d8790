/* SPDX-License-Identifier: MIT */
/* What a loop does around the tick, for any failures, events and set-point before. */
#include "any.h"

static uint32_t any_number(void) {
    uint32_t value;
    ANYTHING(value);
    return value;
}

void proof_loop(void) {
    const uint16_t failures = (uint16_t)any_number();
    const bool was_on = any_bool();
    const bool stopped = omni_may_power_motors(false, was_on, failures);
    /*@ check no_power_without_drive: !stopped; */
    if (failures != 0) {
        const bool switched_on = omni_may_power_motors(true, false, failures);
        /*@ check not_switched_on_over_a_failure: !switched_on; */
    }
    const uint16_t more = omni_add_failures(UINT16_MAX, any_number());
    /*@ check stays_at_its_largest: more == 65535; */
    omni_add_failures(failures, any_number());

    omni_inputs_t inputs = {0};
    inputs.events = any_number();
    omni_trajectory_t plan = {0};
    omni_start_trajectory(&inputs, &plan);
    /*@ check follows: inputs.trajectory == &plan && inputs.setpoint.kind == OMNI_SETPOINT_TRAJECTORY; */
    omni_stop_trajectory(&inputs);
    /*@ check leaves: inputs.setpoint.kind == OMNI_SETPOINT_NONE; */
}
