// SPDX-License-Identifier: MIT
/// @file fuzz_params_file.cpp  The --params file of the PC firmware, and any words behind it. They give a robot that
/// can be configured, or exit code 2.
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <iterator>
#include <string>
#include <vector>

#include "app/base/core.h"
#include "boards/posix/options.h"
#include "check.h"
#include "messages.h"
#include "script.h"

namespace fuzz {
namespace {

constexpr const char *values[] = {"0",    "1",     "-1",   "3",  "4",  "nan",    "inf", "0x1p-3",
                                  "1e39", "1e-50", "0.05", "12", "90", "2.5e0 ", "+3",  ""};

/// A parameter and mostly a value within its range.
std::string line_of(Script &script) {
    const omni_param_info_t &info = omni_param_table[parameter_for(script.number<uint16_t>())];
    const float share = static_cast<float>(script.byte()) / 255.0f;
    const float value = info.minimum + share * (info.maximum - info.minimum);
    const float shown = info.kind == OMNI_PARAM_INT ? std::floor(value) : value;
    std::string text = info.name;
    text += script.one_in(8) ? " = " : "=";
    text += script.one_in(8) ? values[script.below(std::size(values))] : std::to_string(shown);
    text += script.one_in(8) ? " # a comment" : "";
    return text + (script.one_in(8) ? "\r\n" : "\n");
}

/// A few lines that mean something, and sometimes something that does not.
std::string text_of(Script &script) {
    std::string text;
    for (size_t line = script.below(4); line < 4; ++line) {
        text += line_of(script);
    }
    if (script.one_in(4)) {
        text.insert(script.below(text.size()), script.below(3) == 0 ? script.below(300) : size_t{1},
                    static_cast<char>(script.byte()));
    }
    return text;
}

constexpr const char *words[] = {
    "--robot",   "four_wheel", "three_wheel_pins", "--lockstep", "--link", "udp:127.0.0.1:1",
    "--storage", "/dev/null",  "--params",         "--radio",    "0",      "4",
    "9"};

/// Mostly nothing more, sometimes a few words that may be options and their values.
std::vector<std::string> words_of(Script &script) {
    std::vector<std::string> chosen(script.one_in(4) ? 1 + script.below(12) : 0);
    for (std::string &word : chosen) {
        word = words[script.below(std::size(words))];
        if (script.one_in(16)) {
            word += static_cast<char>(script.byte());
        }
    }
    return chosen;
}

/// A file without a name on any disk.
int file_with(const std::string &text) {
    static const int fd = memfd_create("params", 0);
    check(ftruncate(fd, 0) == 0 && pwrite(fd, text.data(), text.size(), 0) == static_cast<ssize_t>(text.size()),
          "the file can be written");
    return fd;
}

void silence_complaints() {
    static const bool silent = std::freopen("/dev/null", "w", stderr) != nullptr;
    static_cast<void>(silent);
}

void run(const std::string &text, const std::vector<std::string> &more) {
    static omni::Options options;
    options = omni::Options{};
    char path[64];
    std::snprintf(path, sizeof path, "/proc/self/fd/%d", file_with(text));
    std::vector<std::string> line = {"omni-firmware", "--params", path};
    line.insert(line.end(), more.begin(), more.end());
    std::vector<char *> arguments;
    for (std::string &word : line) {
        arguments.push_back(word.data());
    }
    int exit_code = -1;
    const bool good = omni::parse_options(static_cast<int>(arguments.size()), arguments.data(), &options, &exit_code);
    figures().bytes += text.size();
    if (!good) {
        check(exit_code == 2, "a bad file or word is a mistake of the user's", exit_code);
        return;
    }
    ++figures().frames;
    check(text.find('\0') == std::string::npos, "a file with zero bytes is no text");
    static omni_robot_config_t config;
    int32_t bad = -1;
    check(omni_robot_config(&config, options.values, &bad) == OMNI_OK, "what is accepted makes a robot", bad);
    for (int32_t i = 0; i < OMNI_PARAM_COUNT; ++i) {
        check(omni_param_check(i, options.values[i], false) == OMNI_OK, "every value is allowed", i);
    }
}

} // namespace
} // namespace fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    fuzz::Script script(data, size);
    ++fuzz::figures().executions;
    fuzz::silence_complaints();
    if (script.below(4) == 0) {
        fuzz::run(std::string(reinterpret_cast<const char *>(data), size), {});
    } else {
        while (!script.ended()) {
            const std::string text = fuzz::text_of(script);
            fuzz::run(text, fuzz::words_of(script));
        }
    }
    return 0;
}
