// SPDX-License-Identifier: MIT
#include "boards/common/robot_values.h"

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "app/tick/robot_setup.h"

namespace omni {
namespace {

void complain_about_robot(const char *name) {
    std::fprintf(stderr, "omni-firmware: --robot '%s': no such robot; there are:", name);
    for (int32_t i = 0; i < omni_builtin_robot_count; ++i) {
        std::fprintf(stderr, " %s", omni_builtin_robots[i].name);
    }
    std::fputc('\n', stderr);
}

/// Cut `text` at a comment and strip blanks.
char *strip(char *text) {
    text[std::strcspn(text, "#\r\n")] = '\0';
    text += std::strspn(text, " \t");
    size_t length = std::strlen(text);
    while (length > 0 && (text[length - 1] == ' ' || text[length - 1] == '\t')) {
        text[--length] = '\0';
    }
    return text;
}

bool take_line(const char *path, int number, char *line, omni_real_t *values) {
    char *name = strip(line);
    if (*name == '\0') {
        return true;
    }
    char *equals = std::strchr(name, '=');
    if (equals == nullptr) {
        std::fprintf(stderr, "omni-firmware: %s:%d: '%s': NAME=VALUE is needed\n", path, number, name);
        return false;
    }
    *equals = '\0';
    name = strip(name);
    const char *text = strip(equals + 1);
    const int32_t index = std::strlen(name) <= OMNI_PARAM_NAME_LEN ? omni_param_find(name) : -1;
    if (index < 0) {
        std::fprintf(stderr, "omni-firmware: %s:%d: %s: there is no such parameter\n", path, number, name);
        return false;
    }
    char *end = nullptr;
    const float value = std::strtof(text, &end);
    const omni_param_info_t &info = omni_param_table[index];
    if (end == text || *end != '\0' || omni_param_check(index, value, false) != OMNI_OK) {
        const char *kind = info.kind == OMNI_PARAM_INT ? "a whole number" : "a number";
        std::fprintf(stderr, "omni-firmware: %s:%d: %s = '%s': %s from %g to %g is needed%s%s\n", path, number,
                     info.name, text, kind, static_cast<double>(info.minimum), static_cast<double>(info.maximum),
                     *info.unit != '\0' ? ", in " : "", info.unit);
        return false;
    }
    values[index] = value;
    return true;
}

constexpr const char *at_the_end = "end";

/// Read up to the next line feed, which is left out. @return nullptr, or why there is no line.
const char *read_line(std::FILE *file, char *line, size_t size) {
    size_t length = 0;
    int c = std::getc(file);
    if (c == EOF) {
        return at_the_end;
    }
    for (; c != EOF && c != '\n'; c = std::getc(file)) {
        if (c == '\0') {
            return "a zero byte: this is no text file";
        }
        if (length + 1 == size) {
            return "line too long";
        }
        line[length++] = static_cast<char>(c);
    }
    line[length] = '\0';
    return nullptr;
}

} // namespace

bool use_robot(const char *name, omni_real_t *values) {
    const int32_t index = omni_builtin_robot_find(name);
    if (index < 0) {
        complain_about_robot(name);
        return false;
    }
    std::memcpy(values, omni_builtin_robots[index].values, OMNI_PARAM_COUNT * sizeof *values);
    return true;
}

bool use_params_file(const char *path, omni_real_t *values) {
    std::FILE *file = std::fopen(path, "r");
    if (file == nullptr) {
        std::fprintf(stderr, "omni-firmware: --params %s: %s\n", path, std::strerror(errno));
        return false;
    }
    char line[256];
    int number = 1;
    const char *problem = read_line(file, line, sizeof line);
    while (problem == nullptr && take_line(path, number, line, values)) {
        ++number;
        problem = read_line(file, line, sizeof line);
    }
    const bool good = problem == at_the_end && std::ferror(file) == 0;
    if (problem == at_the_end && !good) {
        std::fprintf(stderr, "omni-firmware: --params %s: %s\n", path, std::strerror(errno));
    } else if (problem != nullptr && !good) {
        std::fprintf(stderr, "omni-firmware: %s:%d: %s\n", path, number, problem);
    }
    std::fclose(file);
    return good;
}

bool check_robot(const omni_real_t *values) {
    static RobotSetup setup;
    int32_t bad = -1;
    if (make_robot_setup(setup, values, &bad) == OMNI_OK) {
        return true;
    }
    if (bad >= 0) {
        std::fprintf(stderr, "omni-firmware: parameter %s = %g does not fit the others\n", omni_param_table[bad].name,
                     static_cast<double>(values[bad]));
    } else {
        std::fputs("omni-firmware: these parameters make no robot: check WHEELS and the W*_ANGLE\n", stderr);
    }
    return false;
}

} // namespace omni
