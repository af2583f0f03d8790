/* SPDX-License-Identifier: MIT */
#include "controllers.h"

#include <stddef.h>
#include <string.h>

#include "../model/kinematics_inline.h"

#define OMNI_ROW(NAME, name) [OMNI_CTL_MODE_##NAME] = &omni_controller_row_##name,
const omni_controller_t *const omni_controllers[OMNI_CTL_MODE_COUNT] = {OMNI_CTL_MODE_ROWS(OMNI_ROW)};
#undef OMNI_ROW

#define OMNI_ROW(NAME, name) [OMNI_CTL_MODE_##NAME] = #name,
static const char *const controller_names[OMNI_CTL_MODE_COUNT] = {OMNI_CTL_MODE_ROWS(OMNI_ROW)};
#undef OMNI_ROW

const char *omni_controller_name(uint8_t controller) {
    return controller < OMNI_CTL_MODE_COUNT ? controller_names[controller] : NULL;
}

uint8_t omni_controller_demand(uint8_t controller) {
    return controller < OMNI_CTL_MODE_COUNT ? omni_controllers[controller]->demand : (uint8_t)OMNI_DEMAND_NONE;
}

void omni_controllers_reset(omni_control_state_t *control) {
    for (int mode = 0; mode < OMNI_CTL_MODE_COUNT; ++mode) {
        omni_controllers[mode]->reset(control);
    }
    control->ticks = 0;
}

omni_result_t omni_controller_step(omni_control_state_t *control, const omni_robot_config_t *config,
                                   const omni_pose_t *pose, const omni_twist_t *rate, const omni_reference_t *reference,
                                   omni_flag_t saturated) {
    omni_estimate_t estimate;
    if (omni_controller_demand(config->controller) != OMNI_DEMAND_TWIST) {
        return OMNI_ERR_RANGE;
    }
    memset(&estimate, 0, sizeof estimate);
    estimate.pose = *pose;
    estimate.rate = *rate;
    estimate.heading = omni_rotation(pose->theta);
    omni_controllers[config->controller]->step(control, config, &estimate, reference, saturated);
    return OMNI_OK;
}
