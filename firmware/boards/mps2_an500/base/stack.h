// SPDX-License-Identifier: MIT
/// @file stack.h  How much of the one stack was ever used. Reset paints it before anything else runs.
#pragma once

#include <cstddef>
#include <cstdint>

namespace an500 {

constexpr uint32_t stack_paint = 0xA5A5A5A5;

/// Size of the whole stack, bytes.
size_t stack_size();
/// Bytes used at most since reset, or since the last repaint.
size_t stack_used();
/// Repaint the stack below the caller, to measure the calls that follow.
void repaint_stack();
/// Bytes in use now, to be subtracted from stack_used().
size_t stack_depth();

} // namespace an500
