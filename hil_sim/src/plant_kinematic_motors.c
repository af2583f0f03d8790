/* SPDX-License-Identifier: MIT */
/* Plant kinematic+motors: motors (24)-(27) with Coulomb friction and no load from the floor, then rolling (15)-(23). */
#include "motion.h"

static void motors_init(hil_plant_t *plant, const hil_world_config_t *config) {
    (void)config;
    hil_plant_ignore_losses(plant);
    plant->stiffness_N_s_m = 0.0;
}

static void motors_fit(const hil_world_t *world, hil_motion_t *y) {
    hil_rolling_twist(world, y->w, y->v);
}

static void motors_substep(hil_world_t *world, const hil_electrics_t *electrics, const hil_contact_t *contact,
                           hil_motion_t *y, double step_s) {
    (void)step_s;
    hil_contact_substep(world, electrics, contact, y);
    hil_rolling_twist(world, y->w, y->v);
}

static void motors_step(hil_world_t *world, const hil_electrics_t *electrics, double step_s) {
    hil_integrate_substeps(world, electrics, step_s, motors_fit, motors_substep);
}

const hil_plant_model_t hil_plant_kinematic_motors = {.init = motors_init, .step = motors_step};
