// SPDX-License-Identifier: MIT
/// @file law.cpp  Runs the original law. Usage: law core_law|double_law PERIODS. It prints the cost of a period (ns
/// here, instructions on the emulated Cortex-M7) and the voltages of every period.
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "law.h"
#include "stopwatch.h"

namespace {

constexpr uint32_t most_periods = 2000;
law_input_t inputs[most_periods];
float voltages[most_periods * LAW_WHEELS];

float draw(uint32_t &state) {
    state = 1664525u * state + 1013904223u;
    return static_cast<float>(static_cast<int32_t>(state)) * 0x1p-31f;
}

/// Errors of millimetres about a straight path, wheels at up to 4 rad/s.
void make_inputs(uint32_t periods) {
    uint32_t state = 1;
    for (uint32_t n = 0; n < periods; ++n) {
        law_input_t &input = inputs[n];
        for (int axis = 0; axis < 3; ++axis) {
            input.reference[axis] = 0.0005f * static_cast<float>(n % 1000);
            input.pose[axis] = input.reference[axis] + 0.003f * draw(state);
            input.rate[axis] = 0.025f;
        }
        for (int32_t &moved : input.moved_counts) {
            moved = static_cast<int32_t>(120.0f * draw(state));
        }
    }
}

} // namespace

int main(int argc, char **argv) {
    const uint32_t periods = argc > 2 ? static_cast<uint32_t>(std::atoi(argv[2])) : 0;
    if (periods == 0 || periods > most_periods) {
        return 2;
    }
    law_run_t *const run = std::strcmp(argv[1], "core_law") == 0 ? core_law : double_law;
    make_inputs(periods);
    stopwatch::start();
    const uint64_t begin = stopwatch::now();
    run(inputs, periods, voltages);
    const uint32_t taken = stopwatch::between(begin, stopwatch::now());
    std::printf("cost %.9g\nvoltage", static_cast<double>(taken) / periods);
    for (uint32_t i = 0; i < periods * LAW_WHEELS; ++i) {
        std::printf(" %.7g", static_cast<double>(voltages[i]));
    }
    std::printf("\n");
    return 0;
}
