/* SPDX-License-Identifier: MIT */
/* Plant full: everything that world.h says, by plant_contact.c. */
#include "motion.h"

static void full_substep(hil_world_t *world, const hil_electrics_t *electrics, const hil_contact_t *contact, hil_motion_t *y,
                         double step_s) {
    (void)step_s;
    hil_contact_substep(world, electrics, contact, y);
}

static void full_step(hil_world_t *world, const hil_electrics_t *electrics, double step_s) {
    hil_march(world, electrics, step_s, NULL, full_substep);
}

const hil_plant_model_t hil_plant_full = {.takes_torque = true, .step = full_step};
