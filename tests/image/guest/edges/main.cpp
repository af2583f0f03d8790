// SPDX-License-Identifier: MIT
/// @file main.cpp  Has the image's encoder driver watch as many encoders as the command line says, all by interrupts.
/// The host then moves the pins and calls the interrupt's vector; `edges_read` is what the tick calls.
#include <new>

#include "boards/teensy40/encoders.h"

namespace {

constexpr uint8_t pins[OMNI_MAX_WHEELS][2] = {{2, 3}, {4, 5}, {6, 9}, {7, 8}};

omni::EncoderPlan plan;
uint8_t memory alignas(omni::Teensy40Encoders)[sizeof(omni::Teensy40Encoders)];
omni::Teensy40Encoders *encoders;

} // namespace

extern "C" int32_t edges_sum;
extern "C" uint8_t edges_read();
int32_t edges_sum;

/// @return the encoders whose counts can be trusted, as bits; the sum of the counts is in edges_sum.
uint8_t edges_read() {
    int32_t counts[OMNI_MAX_WHEELS] = {};
    const uint8_t valid = encoders->read(counts);
    edges_sum = 0;
    for (const int32_t count : counts) {
        edges_sum += count;
    }
    return valid;
}

int main(int argc, char **argv) {
    if (argc != 2) {
        return 2;
    }
    plan.wheels = static_cast<uint8_t>(argv[1][0] - '0');
    for (uint8_t i = 0; i < plan.wheels; ++i) {
        plan.wheel[i].pin_a = pins[i][0];
        plan.wheel[i].pin_b = pins[i][1];
    }
    encoders = new (memory) omni::Teensy40Encoders(plan);
    encoders->begin();
    return edges_read() == (1 << plan.wheels) - 1 && edges_sum == 0 ? 0 : 1;
}
