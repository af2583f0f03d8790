/* SPDX-License-Identifier: MIT */
/* Any plan of an experiment, on any state of one that goes on. */
#include "any.h"

void proof_excitation(void) {
    omni_excitation_state_t exciter;
    omni_excitation_t plan;
    uint8_t place;
    ANYTHING(exciter);
    exciter.started = any_bool();
    ANYTHING(plan);
    ANYTHING(place);
    const uint8_t wheels = (uint8_t)Frama_C_interval(3, OMNI_MAX_WHEELS);
    if (omni_excitation_start(&exciter, &plan, wheels) == OMNI_OK) {
        /*@ check ends: 0 < exciter.ticks_left <= OMNI_EXCITATION_MAX_TICKS; */
        /*@ check known: OMNI_EXCITATION_NONE < exciter.plan.place < OMNI_EXCITATION_COUNT; */
    } else {
        /*@ check off: exciter.ticks_left == 0; */
    }
    const bool open_loop = omni_excitation_fits(place, OMNI_SETPOINT_DUTY);
    /*@ check never_over_duties: !open_loop; */
    (void)omni_excitation_fits(place, OMNI_SETPOINT_NONE);
}
