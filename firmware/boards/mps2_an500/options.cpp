// SPDX-License-Identifier: MIT
#include "boards/mps2_an500/options.h"

#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "boards/mps2_an500/base/semihosting.h"

namespace omni {
namespace {

constexpr uint32_t longest_watchdog_ms = 60'000;

constexpr const char *help =
    "usage: omni-firmware [--robot NAME | --params FILE] [--links N] [--storage FILE] [--lockstep] ...\n"
    "\n"
    "The robot's firmware on an emulated Cortex-M7. `omni sitl --board cortex-m7` runs it; by hand:\n"
    "qemu-system-arm -M mps2-an500 -kernel omni-firmware-mps2.elf -display none -monitor none -serial "
    "tcp::5760,server=on\n"
    "    -semihosting-config enable=on,target=native,arg=omni-firmware,arg=--robot,arg=three_wheel\n"
    "\n"
    "  --robot NAME     built-in robot: its geometry, motors and gains (default: three_wheel)\n"
    "  --params FILE    parameters of another robot, one NAME=VALUE per line, '#' starts a comment; put after\n"
    "                   --robot it changes single values\n"
    "  --links N        speak MAVLink on the first N serial ports, 1 to 4 (default 1)\n"
    "  --storage FILE   keep stored parameters there (default: forgotten at the end)\n"
    "  --lockstep       hardware-in-the-loop from the start: one control tick per OMNI_HIL_SENSORS message\n"
    "  --console-link   with --lockstep: the last link is the emulator's standard input and output, which is much\n"
    "                   faster; give --log too\n"
    "  --pins           encoders, I2C, supply and a first serial line are simulated by the host, over the emulator's\n"
    "                   standard input and output (hil_sim/pins.py); give --log too\n"
    "  --log FILE       append what is said to this file instead of saying it on the console\n"
    "  --catch-up       a host that was busy for a while makes no time jump: missed ticks run at their due times\n"
    "  --watchdog MS    reset after this time without a background pass (default 2000; 0: never)\n"
    "  --reset-cause C  begin as after power_on, watchdog, software or crash\n"
    "  --crash-resets   start again after a crash, as the robot does, instead of ending with exit code 70\n"
    "  --inject         a 'c' on the fifth serial port crashes the program, an 'h' hangs it\n"
    "  --version, --help\n"
    "\n"
    "Words must not contain blanks; files are the host's. Everything is said on the console.";

bool use_number(const char *name, const char *text, uint32_t lowest, uint32_t highest, uint32_t *number) {
    char *end = nullptr;
    const unsigned long value = std::strtoul(text, &end, 10);
    if (end == text || *end != '\0' || value < lowest || value > highest) {
        std::fprintf(stderr, "omni-firmware: %s '%s': a whole number from %lu to %lu is needed\n", name, text,
                     static_cast<unsigned long>(lowest), static_cast<unsigned long>(highest));
        return false;
    }
    *number = static_cast<uint32_t>(value);
    return true;
}

bool use_links(const char *text, Options *options) {
    uint32_t count = 0;
    const bool good = use_number("--links", text, 1, Board::max_ports, &count);
    options->link_count = count;
    return good;
}

bool use_watchdog(const char *text, Options *options) {
    return use_number("--watchdog", text, 0, longest_watchdog_ms, &options->watchdog_ms);
}

bool use_reset_cause(const char *text, Options *options) {
    constexpr const char *names[] = {"power_on", "watchdog", "software", "crash", "over_temperature"};
    for (size_t i = 0; i < sizeof names / sizeof *names; ++i) {
        if (std::strcmp(text, names[i]) == 0) {
            options->reset_cause = static_cast<ResetCause>(i);
            return true;
        }
    }
    std::fprintf(
        stderr,
        "omni-firmware: --reset-cause '%s': power_on, watchdog, software, crash or over_temperature is needed\n", text);
    return false;
}

bool use_log(const char *path, Options *options) {
    options->log = path;
    if (an500::semihosting_print_to(path)) {
        return true;
    }
    std::fprintf(stderr, "omni-firmware: --log %s: %s\n", path, std::strerror(an500::semihosting_errno()));
    return false;
}

constexpr OptionRow<Options> rows[] = {{"--console-link", &Options::console_link, nullptr},
                                       {"--pins", &Options::pins, nullptr},
                                       {"--catch-up", &Options::catch_up, nullptr},
                                       {"--crash-resets", &Options::crash_resets, nullptr},
                                       {"--inject", &Options::inject, nullptr},
                                       {"--links", nullptr, use_links},
                                       {"--watchdog", nullptr, use_watchdog},
                                       {"--reset-cause", nullptr, use_reset_cause},
                                       {"--log", nullptr, use_log}};

} // namespace

bool parse_options(int argc, char **argv, Options *options, int *exit_code) {
    if (!parse_words(argc, argv, help, ", emulated Cortex-M7", rows, options, exit_code)) {
        return false;
    }
    if (options->console_link && !(options->lockstep && options->log != nullptr)) {
        std::fputs("omni-firmware: --console-link needs --lockstep and --log\n", stderr);
        return false;
    }
    if (options->pins && (options->lockstep || options->log == nullptr || options->link_count == Board::max_ports)) {
        std::fputs("omni-firmware: --pins needs --log, less than 4 links and no --lockstep\n", stderr);
        return false;
    }
    return check_robot(options->values);
}

} // namespace omni
