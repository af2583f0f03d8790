/* SPDX-License-Identifier: MIT */
/* Plant full: everything that world.h says, by plant_contact.c. */
#include "motion.h"

const hil_plant_model_t hil_plant_full = {.takes_torque = true, .step = hil_contact_step};
