// SPDX-License-Identifier: MIT
/// @file options.h  Command line of the emulated firmware.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"
#include "boards/common/option_loop.h"

namespace omni {

struct Options : CommonOptions {
    size_t link_count = 1;     ///< UART0 and on, and the console
    const char *log = nullptr; ///< file for text
    bool catch_up = false;
    bool crash_resets = false;
    bool inject = false;
    bool pins = false;           ///< the world is at the pins
    bool console_link = false;   ///< the last link is the console
    uint32_t watchdog_ms = 2000; ///< 0: off
    ResetCause reset_cause = ResetCause::power_on;
};

/// @return true: run; false: end with *exit_code (0 after --help and --version, 2 after a mistake, which has been
/// explained).
bool parse_options(int argc, char **argv, Options *options, int *exit_code);

} // namespace omni
