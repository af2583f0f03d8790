// SPDX-License-Identifier: MIT
/// @file core.h  The control core, seen from C++.
#pragma once

extern "C" {
#include "omni/omni.h"
}
