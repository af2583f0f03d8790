/* SPDX-License-Identifier: MIT */
/* Plant slip (6), (7): wheels on the floor as in `full`, without roller drag, Coulomb friction and battery resistance.
 */
#include "motion.h"

static void slip_init(hil_plant_t *plant, const hil_world_config_t *config) {
    hil_plant_ignore_losses(plant);
    hil_limits_init(plant, config);
    plant->coulomb_N_m = 0.0;
}

/* (7) has no bearing friction, (24) has. */
static void slip_source(hil_world_t *world, uint32_t source) {
    world->plant.viscous_N_m_s = source == HIL_SOURCE_TORQUE ? 0.0 : world->config.motor_viscous_N_m_s;
}

const hil_plant_model_t hil_plant_slip = {
    .takes_torque = true, .init = slip_init, .source = slip_source, .step = hil_contact_step};
