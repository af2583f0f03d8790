/* SPDX-License-Identifier: MIT */
/* Plant full: everything that world.h says, by plant_contact.c, on the floor of floor.c. */
#include "motion.h"

static void full_step(hil_world_t *world, const hil_electrics_t *electrics, double step_s) {
    if (world->plant.uneven) {
        hil_floor_step(world, step_s);
    }
    hil_contact_step(world, electrics, step_s);
}

const hil_plant_model_t hil_plant_full = {.takes_torque = true, .init = hil_floor_init, .step = full_step};
