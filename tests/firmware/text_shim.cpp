// SPDX-License-Identifier: MIT
// extern "C" access to the texts that the firmware builds, and to how many of them may go. Each call gives one text;
// the next call replaces it.
#include "app/base/text.h"
#include "app/link/text_gate.h"

namespace {

omni::Text text;
omni::TextGate gate{1};

const char *built(const omni::Text &of) {
    text = of;
    return text.data();
}

} // namespace

extern "C" {

const char *text_of_number(uint32_t number) {
    return built(omni::Text().add(number));
}

const char *text_of_address(uint32_t number) {
    return built(omni::Text().add_hex(number));
}

const char *text_of_float(float value) {
    return built(omni::Text().add(value));
}

/// @param first, second one behind the other.
const char *text_joined(const char *first, const char *second) {
    return built(omni::Text().add(first).add(second));
}

size_t text_length() {
    return text.length();
}

void gate_new(uint64_t interval_us) {
    gate = omni::TextGate(interval_us);
}

bool gate_pass(uint64_t now_us, uint32_t sum) {
    return gate.pass(now_us, sum);
}

void gate_count(uint32_t number) {
    gate.count(number);
}

uint32_t gate_take_left_out(uint64_t now_us) {
    return gate.take_suppressed_count(now_us);
}
}
