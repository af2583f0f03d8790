// SPDX-License-Identifier: MIT
#include "boards/posix/options.h"

#include <cstdio>

namespace omni {
namespace {

constexpr const char *help =
    "usage: omni-firmware [--robot NAME | --params FILE] [--link LINK]... [--storage FILE] [--lockstep]\n"
    "                     [--end-with-stdin]\n"
    "\n"
    "The robot's firmware as a process of this computer.\n"
    "\n"
    "  --robot NAME     built-in robot: its geometry, motors and gains (default: three_wheel)\n"
    "  --params FILE    parameters of another robot, one NAME=VALUE per line, '#' starts a comment; put after\n"
    "                   --robot it changes single values\n"
    "  --link LINK      where MAVLink is spoken, up to four times (default tcp:127.0.0.1:5760)\n"
    "                     tcp:HOST:PORT   listen there, port 0 picks a free one\n"
    "                     udp:HOST:PORT   send there, receive the answers\n"
    "                     pty[:SYMLINK]   a pseudo-terminal, like a USB serial port\n"
    "  --storage FILE   keep stored parameters there (default: forgotten at the end)\n"
    "  --radio N        that link, 1..4, is a radio: a signing key closes it, and its line is as slow as LINK2_BAUD "
    "(only\n"
    "                   link 2); 0: no link is (default: 2, as fast as it goes)\n"
    "  --lockstep       hardware-in-the-loop from the start: one control tick per OMNI_HIL_SENSORS message\n"
    "  --end-with-stdin end when standard input does: with a pipe there, with the program that started it, even if "
    "that\n"
    "                   one is killed\n"
    "  --version, --help\n"
    "\n"
    "When it listens, one line of JSON on standard output names the links; everything else goes to standard error.\n"
    "SIGINT, SIGTERM and SIGHUP end it. Exit code 0: ended so; 2: wrong arguments, or a link or file that cannot be "
    "used.\n"
    "\n"
    "example: omni-firmware --robot three_wheel --link tcp:127.0.0.1:5760 --link pty:/tmp/robot";

bool add_link(const char *link, Options *options) {
    if (options->link_count == Board::max_ports) {
        std::fprintf(stderr, "omni-firmware: at most %zu links\n", Board::max_ports);
        return false;
    }
    options->links[options->link_count++] = link;
    return true;
}

bool use_radio(const char *number, Options *options) {
    if (number[0] < '0' || number[0] > '0' + static_cast<char>(Board::max_ports) || number[1] != '\0') {
        std::fprintf(stderr, "omni-firmware: --radio '%s': the number of a link, 1..4, or 0 is needed\n", number);
        return false;
    }
    options->radio_line = true;
    options->radios = number[0] == '0' ? uint8_t{0} : static_cast<uint8_t>(1u << (number[0] - '1'));
    return true;
}

constexpr OptionRow<Options> rows[] = {{"--end-with-stdin", &Options::end_with_stdin, nullptr},
                                       {"--link", nullptr, add_link},
                                       {"--radio", nullptr, use_radio}};

} // namespace

bool parse_options(int argc, char **argv, Options *options, int *exit_code) {
    if (!parse_words(argc, argv, help, "", rows, options, exit_code)) {
        return false;
    }
    if (options->link_count == 0) {
        options->links[options->link_count++] = "tcp:127.0.0.1:5760";
    }
    return check_robot(options->values);
}

} // namespace omni
