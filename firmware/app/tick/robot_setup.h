// SPDX-License-Identifier: MIT
/// @file robot_setup.h  Setup of the tick derived from a parameter set: core configuration and motor wiring.
#pragma once

#include "app/base/core.h"
#include "app/drivers/motor_driver.h"

namespace omni {

struct RobotSetup {
    omni_robot_config_t config{};
    Wiring wiring;
};

/// Build a setup from parameters.
/// @param values OMNI_PARAM_COUNT entries. @param bad_index out: invalid parameter, or -1.
/// @return OMNI_ERR_RANGE where two bridge inputs are on one channel of the PWM chip; otherwise as omni_robot_config().
omni_result_t make_robot_setup(RobotSetup &setup, const omni_real_t *values, int32_t *bad_index);

/// Parameters that are valid on every board: defaults with evenly spaced wheels on separate channels. For a program
/// without valid parameters of a robot; it must not drive. @param values out,
/// OMNI_PARAM_COUNT entries.
void fallback_parameters(omni_real_t *values);

} // namespace omni
