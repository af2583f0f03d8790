// SPDX-License-Identifier: MIT
#include "boards/mps2_an500/reset_record.h"

#include <cstring>

namespace omni {
namespace {

constexpr uint32_t mark = 0x6F6D6E69;
constexpr size_t most_lines = 5;
constexpr size_t line_size = 51;

struct ResetRecord {
    uint32_t mark; ///< what follows was written by a program before the reset
    ResetCause cause;
    uint32_t lines;
    char text[most_lines][line_size];
};

[[gnu::section(".noinit")]] ResetRecord record;

void record_line(const char *text) {
    if (record.lines < most_lines) {
        std::strncpy(record.text[record.lines], text, line_size - 1);
        record.text[record.lines++][line_size - 1] = '\0';
    }
}

} // namespace

ResetCause read_reset_record(ResetCause first) {
    if (record.mark != mark) {
        std::memset(&record, 0, sizeof record);
        return first;
    }
    record.mark = 0;
    return record.cause;
}

void record_reset_cause(ResetCause cause) {
    record.mark = mark;
    record.cause = cause;
    record.lines = 0;
}

void record_crash(const an500::Fault &fault) {
    record_reset_cause(ResetCause::crash);
    an500::describe_fault(fault, record_line);
}

const char *recorded_crash_line(size_t number) {
    return number < record.lines ? record.text[number] : nullptr;
}

} // namespace omni
