// SPDX-License-Identifier: MIT
/// @file core.h  The control core's C headers for C++.
#pragma once

extern "C" {
#include "omni/omni.h"
}
