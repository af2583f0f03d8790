// SPDX-License-Identifier: MIT
/// @file integer_check.h  Integer arguments in MAVLink commands, whose parameters are floats.
#pragma once

#include <cmath>

namespace omni {

/// Is it an integer in [low, high]? NaN: false.
inline bool is_integer_within(float value, float low, float high) {
    return value >= low && value <= high && value == std::floor(value);
}

} // namespace omni
