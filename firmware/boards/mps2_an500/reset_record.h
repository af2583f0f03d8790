// SPDX-License-Identifier: MIT
/// @file reset_record.h  Memory that survives a reset: its cause, and the report of a crash.
#pragma once

#include <cstddef>

#include "app/base/board.h"
#include "boards/mps2_an500/base/fault.h"

namespace omni {

/// Once after each start. @param first cause after power-on. @return why the processor started.
ResetCause read_reset_record(ResetCause first);
/// Record the cause of the reset that follows.
void record_reset_cause(ResetCause cause);
/// Record a crash: its cause and report.
void record_crash(const an500::Fault &fault);
/// Line of the crash report from before this start; nullptr: no more.
const char *recorded_crash_line(size_t number);

} // namespace omni
