// SPDX-License-Identifier: MIT
/// @file memory.h  How much of the stack and of the heap was never used.
#pragma once

#include "app/base/board.h"

namespace omni {

/// Fill the unused part of the stack with a pattern. Early, and only once.
void paint_stack();

/// Finds how far the pattern has been overwritten.
MemoryFree memory_free();

} // namespace omni
