// SPDX-License-Identifier: MIT
/// @file options.h  Command line of the firmware process.
#pragma once

#include <cstddef>

#include "app/base/board.h"
#include "boards/common/option_loop.h"

namespace omni {

struct Options : CommonOptions {
    const char *links[Board::max_ports] = {};
    size_t link_count = 0;
    bool end_with_stdin = false; ///< exit at the end of standard input
    uint8_t radios = 0b10;       ///< a bit per link
    bool radio_line = false;     ///< a radio was requested: its line has a baud rate
};

/// @return true: run; false: end with *exit_code (0 after --help and --version, 2 after a mistake, which has been
/// explained).
bool parse_options(int argc, char **argv, Options *options, int *exit_code);

} // namespace omni
