// SPDX-License-Identifier: MIT
/// @file whole.h  A command's parameters are floats; some of them count.
#pragma once

#include <cmath>

namespace omni {

/// A whole number within these bounds. A NaN is none.
inline bool is_whole(float value, float low, float high) {
    return value >= low && value <= high && value == std::floor(value);
}

} // namespace omni
