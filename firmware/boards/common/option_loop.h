// SPDX-License-Identifier: MIT
/// @file option_loop.h  The command line of a firmware program: a row per option, and the loop over the arguments.
/// Errors go to standard error.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <cstring>

#include "app/base/core.h"
#include "boards/common/robot_values.h"
#include "omni/version_gen.h"

namespace omni {

/// What every program takes: --robot, --params, --storage, --lockstep. A program's own options derive from it.
struct CommonOptions {
    const char *storage = nullptr;
    bool lockstep = false;
    omni_real_t values[OMNI_PARAM_COUNT] = {}; ///< the robot's own parameters
};

/// One option: a flag without a value, or what is done with the value. @return of `take`: false after saying what is
/// wrong.
template <class Options>
struct OptionRow {
    const char *name;
    bool Options::*flag;
    bool (*take)(const char *value, Options *options);
};

template <class Options>
const OptionRow<Options> *find_option(const char *name, const OptionRow<Options> *rows, size_t count) {
    const auto *end = rows + count;
    const auto *found = std::find_if(rows, end, [name](const auto &row) { return std::strcmp(row.name, name) == 0; });
    return found == end ? nullptr : found;
}

/// @return true if the word was --help or --version and has its answer. @param what the program is, behind the version.
inline bool answer(const char *name, const char *help, const char *what) {
    if (std::strcmp(name, "--help") == 0) {
        std::puts(help);
        return true;
    }
    if (std::strcmp(name, "--version") == 0) {
        std::printf("omni-firmware %s (%s%s)%s\n", OMNI_VERSION_STRING, OMNI_GIT_HASH_STRING,
                    OMNI_GIT_DIRTY != 0 ? ", dirty" : "", what);
        return true;
    }
    return false;
}

/// Takes all words; the caller looks whether the options fit each other, and then `check_robot`. @param rows the
/// program's own.
/// @return true: go on; false: end with *exit_code (0 after --help and --version, 2 after a mistake, which has been
/// explained).
template <class Options, size_t N>
bool parse_words(int argc, char **argv, const char *help, const char *what, const OptionRow<Options> (&rows)[N],
                 Options *options, int *exit_code) {
    static const OptionRow<Options> common[] = {
        {"--lockstep", &Options::lockstep, nullptr},
        {"--robot", nullptr, [](const char *value, Options *o) { return use_robot(value, o->values); }},
        {"--params", nullptr, [](const char *value, Options *o) { return use_params_file(value, o->values); }},
        {"--storage", nullptr, [](const char *value, Options *o) { return (o->storage = value) != nullptr; }}};
    *exit_code = 2;
    if (!use_robot(default_robot, options->values)) {
        return false;
    }
    for (int i = 1; i < argc; ++i) {
        const char *name = argv[i];
        if (answer(name, help, what)) {
            *exit_code = 0;
            return false;
        }
        const OptionRow<Options> *row = find_option(name, rows, N);
        row = row != nullptr ? row : find_option(name, common, sizeof common / sizeof *common);
        if (row == nullptr || (row->take != nullptr && i + 1 == argc)) {
            const char *problem = row == nullptr ? "is unknown" : "needs a value";
            std::fprintf(stderr, "omni-firmware: '%s' %s; see --help\n", name, problem);
            return false;
        }
        if (row->take == nullptr) {
            options->*row->flag = true;
        } else if (!row->take(argv[++i], options)) {
            return false;
        }
    }
    return true;
}

} // namespace omni
