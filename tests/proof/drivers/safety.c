/* SPDX-License-Identifier: MIT */
/* Every state and event, one after another, and then any numbers at all. */
#include "any.h"

static void next(omni_safety_state_t state, omni_safety_event_t event) {
    const omni_safety_state_t next = omni_safety_next(state, event);
    /*@ check a_state: next < OMNI_STATE_COUNT; */
    if (event == OMNI_SAFETY_ESTOP) {
        /*@ check a_stop_wins: next == OMNI_STATE_ESTOP; */
    }
    if (next == OMNI_STATE_ARMED && state != OMNI_STATE_ARMED) {
        /*@ check armed_from_disarmed: state == OMNI_STATE_DISARMED && event == OMNI_SAFETY_ARM; */
    }
    if (state == OMNI_STATE_ESTOP && event != OMNI_SAFETY_ESTOP_CLEAR) {
        /*@ check latched: next == OMNI_STATE_ESTOP; */
    }
}

static void numbers_that_are_none(void) {
    omni_safety_state_t state;
    omni_safety_event_t event;
    uint32_t bits;
    ANYTHING(state);
    ANYTHING(event);
    ANYTHING(bits);
    const omni_safety_state_t next = omni_safety_next(state, event);
    /*@ check still_a_state: next < OMNI_STATE_COUNT; */
    const char *name = omni_safety_state_name(state);
    const char *fault = omni_fault_name(bits);
    /*@ check names: \valid_read(name) && \valid_read(fault); */
}

void proof_safety(void) {
    for (uint8_t state = 0; state < OMNI_STATE_COUNT; ++state) {
        for (uint8_t event = 0; event < OMNI_SAFETY_EVENT_COUNT; ++event) {
            next((omni_safety_state_t)state, (omni_safety_event_t)event);
        }
    }
    numbers_that_are_none();
}
