// SPDX-License-Identifier: MIT
/// @file robot_values.h  A robot's own parameters for boards that get them at start. Errors go to standard error.
#pragma once

#include "app/base/core.h"

namespace omni {

constexpr const char *default_robot = "three_wheel";

/// Take a built-in robot's values. @param values OMNI_PARAM_COUNT entries. @return false after naming the robots there
/// are.
bool use_robot(const char *name, omni_real_t *values);
/// Read NAME=VALUE lines over `values`. @return false after naming file, line, key and what is allowed.
bool use_params_file(const char *path, omni_real_t *values);
/// The values fit each other. @return false after saying which one does not.
bool check_robot(const omni_real_t *values);

} // namespace omni
