// SPDX-License-Identifier: MIT
/// @file robot_setup.h  What a parameter set becomes for the tick: the core's configuration, and how the motors are
/// wired.
#pragma once

#include "app/base/core.h"
#include "app/drivers/motor_driver.h"

namespace omni {

struct RobotSetup {
    omni_robot_config_t config{};
    Wiring wiring;
};

/// Build a setup, or say why these values make none.
/// @param values OMNI_PARAM_COUNT entries. @param bad_index the parameter to blame, or -1.
/// @return OMNI_ERR_RANGE where two bridge inputs are on one channel of the PWM chip; otherwise as omni_robot_config().
omni_result_t make_robot_setup(RobotSetup &setup, const omni_real_t *values, int32_t *bad_index);

/// Values that make a setup on every board: the table's defaults with wheels evenly spread and wired apart. For a
/// program that has no robot's values; nothing is known of the motors, so it must not drive. @param values out,
/// OMNI_PARAM_COUNT entries.
void fallback_values(omni_real_t *values);

} // namespace omni
