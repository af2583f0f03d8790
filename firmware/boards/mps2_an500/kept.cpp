// SPDX-License-Identifier: MIT
#include "boards/mps2_an500/kept.h"

#include <cstring>

namespace omni {
namespace {

constexpr uint32_t mark = 0x6F6D6E69;
constexpr size_t most_lines = 5;
constexpr size_t line_size = 51;

struct Kept {
    uint32_t mark; ///< what follows was written by a program before the reset
    ResetCause cause;
    uint32_t lines;
    char text[most_lines][line_size];
};

[[gnu::section(".noinit")]] Kept kept;

void keep_line(const char *text) {
    if (kept.lines < most_lines) {
        std::strncpy(kept.text[kept.lines], text, line_size - 1);
        kept.text[kept.lines++][line_size - 1] = '\0';
    }
}

} // namespace

ResetCause begin_kept(ResetCause first) {
    if (kept.mark != mark) {
        std::memset(&kept, 0, sizeof kept);
        return first;
    }
    kept.mark = 0;
    return kept.cause;
}

void keep_cause(ResetCause cause) {
    kept.mark = mark;
    kept.cause = cause;
    kept.lines = 0;
}

void keep_crash(const an500::Fault &fault) {
    keep_cause(ResetCause::crash);
    an500::describe_fault(fault, keep_line);
}

const char *kept_crash_line(size_t number) {
    return number < kept.lines ? kept.text[number] : nullptr;
}

} // namespace omni
