// SPDX-License-Identifier: MIT
/// @file fuzz_sequence.cpp  Sequences of frames on several links, changed by whole actions; a stop must always act.
#include "action.h"
#include "check.h"
#include "sequence.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    constexpr size_t most_actions = 200;
    fuzz::Actions actions = fuzz::actions_of(data, size);
    ++fuzz::figures().executions;
    if (actions.empty()) {
        return 0;
    }
    actions.resize(actions.size() < most_actions ? actions.size() : most_actions);
    fuzz::Sequence(actions[0]).run(actions);
    return 0;
}

extern "C" size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t capacity, unsigned seed) {
    return fuzz::mutate_actions(data, size, capacity, seed);
}

extern "C" size_t LLVMFuzzerCustomCrossOver(const uint8_t *first, size_t first_size, const uint8_t *second,
                                            size_t second_size, uint8_t *out, size_t capacity, unsigned seed) {
    return fuzz::cross_actions(fuzz::actions_of(first, first_size), fuzz::actions_of(second, second_size), out,
                               capacity, seed);
}
