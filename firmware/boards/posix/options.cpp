// SPDX-License-Identifier: MIT
#include "boards/posix/options.h"

#include <cstdio>
#include <cstring>

#include "boards/common/robot_values.h"
#include "omni/version_gen.h"

namespace omni {
namespace {

constexpr int usage_error = 2;

void print_help() {
    std::puts(
        "usage: omni-firmware [--robot NAME | --params FILE] [--link LINK]... [--storage FILE] [--lockstep [--asleep]]\n"
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
        "  --radio N        that link, 1..4, is a radio: a signing key closes it, and its line is as slow as LINK2_BAUD (only\n"
        "                   link 2); 0: no link is (default: 2, as fast as it goes)\n"
        "  --lockstep       host-in-the-loop from the start: one control tick per OMNI_HIL_SENSORS message\n"
        "  --asleep         wait for them asleep only; else it looks for them for a moment first, if it has a second "
        "processor\n"
        "  --end-with-stdin end when standard input does: with a pipe there, with the program that started it, even if that\n"
        "                   one is killed\n"
        "  --version, --help\n"
        "\n"
        "When it listens, one line of JSON on standard output names the links; everything else goes to standard error.\n"
        "SIGINT, SIGTERM and SIGHUP end it. Exit code 0: ended so; 2: wrong arguments, or a link or file that cannot be used.\n"
        "\n"
        "example: omni-firmware --robot three_wheel --link tcp:127.0.0.1:5760 --link pty:/tmp/robot");
}

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

bool take_option(const char *name, const char *value, Options *options) {
    if (std::strcmp(name, "--robot") == 0) {
        return use_robot(value, options->values);
    }
    if (std::strcmp(name, "--params") == 0) {
        return use_params_file(value, options->values);
    }
    if (std::strcmp(name, "--link") == 0) {
        return add_link(value, options);
    }
    if (std::strcmp(name, "--storage") == 0) {
        options->storage = value;
        return true;
    }
    if (std::strcmp(name, "--radio") == 0) {
        return use_radio(value, options);
    }
    std::fprintf(stderr, "omni-firmware: unknown option '%s'; see --help\n", name);
    return false;
}

} // namespace

bool parse_options(int argc, char **argv, Options *options, int *exit_code) {
    *exit_code = usage_error;
    if (!use_robot(default_robot, options->values)) {
        return false;
    }
    for (int i = 1; i < argc; ++i) {
        const char *name = argv[i];
        if (std::strcmp(name, "--help") == 0 || std::strcmp(name, "--version") == 0) {
            *exit_code = 0;
            if (name[2] == 'h') {
                print_help();
            } else {
                std::printf("omni-firmware %s (%s%s)\n", OMNI_VERSION_STRING, OMNI_GIT_HASH_STRING,
                            OMNI_GIT_DIRTY != 0 ? ", dirty" : "");
            }
            return false;
        }
        if (std::strcmp(name, "--lockstep") == 0) {
            options->lockstep = true;
            continue;
        }
        if (std::strcmp(name, "--asleep") == 0) {
            options->looks = false;
            continue;
        }
        if (std::strcmp(name, "--end-with-stdin") == 0) {
            options->end_with_stdin = true;
            continue;
        }
        if (i + 1 == argc) {
            std::fprintf(stderr, "omni-firmware: '%s' is unknown or needs a value; see --help\n", name);
            return false;
        }
        if (!take_option(name, argv[++i], options)) {
            return false;
        }
    }
    if (options->link_count == 0) {
        options->links[options->link_count++] = "tcp:127.0.0.1:5760";
    }
    return check_robot(options->values);
}

} // namespace omni
