/* SPDX-License-Identifier: MIT */
/* Plant full: everything that world.h says, by plant_contact.c, on the floor of floor.c, behind the gears of
 * backlash.c. */
#include "motion.h"

static void full_step(hil_world_t *world, const hil_electrics_t *electrics, double step_s) {
    if (world->plant.uneven) {
        hil_floor_step(world, step_s);
    }
    if (world->plant.play) {
        hil_backlash_step(world, electrics, step_s);
    } else {
        hil_contact_step(world, electrics, step_s);
    }
}

static void full_init(hil_plant_t *plant, const hil_world_config_t *config) {
    hil_floor_init(plant, config);
    hil_backlash_init(plant, config);
    hil_limits_init(plant, config);
}

const hil_plant_model_t hil_plant_full = {.takes_torque = true, .init = full_init, .step = full_step};
