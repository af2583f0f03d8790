/* SPDX-License-Identifier: MIT */
#include "omni/loop.h"

bool omni_may_power_motors(bool drive, bool was_on, uint16_t failures) {
    return drive && (was_on || failures == 0);
}

uint16_t omni_add_failures(uint16_t failures, uint32_t more) {
    const uint32_t left = (uint32_t)UINT16_MAX - failures;
    return (uint16_t)(failures + (more < left ? more : left));
}

void omni_start_trajectory(omni_inputs_t *inputs, const omni_trajectory_t *plan) {
    inputs->trajectory = plan;
    inputs->setpoint.kind = OMNI_SETPOINT_TRAJECTORY;
    inputs->events = (inputs->events | (uint32_t)OMNI_EVENT_TRAJECTORY_START) & ~(uint32_t)OMNI_EVENT_TRAJECTORY_STOP;
}

void omni_stop_trajectory(omni_inputs_t *inputs) {
    inputs->setpoint.kind = OMNI_SETPOINT_NONE;
    inputs->events |= (uint32_t)OMNI_EVENT_TRAJECTORY_STOP;
}
