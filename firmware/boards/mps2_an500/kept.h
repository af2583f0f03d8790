// SPDX-License-Identifier: MIT
/// @file kept.h  What survives a reset: why it happened, and the words about a crash.
#pragma once

#include <cstddef>

#include "app/base/board.h"
#include "boards/mps2_an500/base/fault.h"

namespace omni {

/// Once after each start. @param first what to say if there was no reset, only power. @return why the processor
/// started.
ResetCause begin_kept(ResetCause first);
/// Say why the reset that follows happens.
void keep_cause(ResetCause cause);
/// Keep the words about a crash; its cause too.
void keep_crash(const an500::Fault &fault);
/// Line of the crash before this start, nullptr: no more.
const char *kept_crash_line(size_t number);

} // namespace omni
