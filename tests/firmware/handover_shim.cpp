// SPDX-License-Identifier: MIT
/// @file handover_shim.cpp  A Handover of numbers for Python: background and tick take turns, as the caller says.
#include <new>

#include "app/base/snapshot.h"

namespace {
omni::Handover<int> handover;
const int *taken = nullptr;
} // namespace

extern "C" {
void handover_reset() {
    handover.~Handover();
    new (&handover) omni::Handover<int>();
    taken = nullptr;
}
/// Write a value where the next one is prepared. @return what the tick has now, -1: nothing
int handover_prepare(int value) {
    handover.scratch() = value;
    return taken == nullptr ? -1 : *taken;
}
void handover_publish() {
    handover.publish();
}
void handover_withdraw() {
    handover.withdraw();
}
/// @return whether there was a new value
bool handover_take() {
    const int *next = handover.take();
    taken = next == nullptr ? taken : next;
    return next != nullptr;
}
int handover_taken() {
    return taken == nullptr ? -1 : *taken;
}
}
