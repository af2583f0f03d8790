// SPDX-License-Identifier: MIT
/// @file mailbox_shim.cpp  A Mailbox of numbers for Python: background and tick take turns, as the caller says.
#include <new>

#include "app/base/snapshot.h"

namespace {
omni::Mailbox<int> mailbox;
const int *taken = nullptr;
} // namespace

extern "C" {
void mailbox_reset() {
    mailbox.~Mailbox();
    new (&mailbox) omni::Mailbox<int>();
    taken = nullptr;
}
/// Write a value where the next one is prepared. @return what the tick has now, -1: nothing
int mailbox_prepare(int value) {
    mailbox.scratch() = value;
    return taken == nullptr ? -1 : *taken;
}
void mailbox_publish() {
    mailbox.publish();
}
void mailbox_withdraw() {
    mailbox.withdraw();
}
/// @return whether there was a new value
bool mailbox_take() {
    const int *next = mailbox.take();
    taken = next == nullptr ? taken : next;
    return next != nullptr;
}
int mailbox_taken() {
    return taken == nullptr ? -1 : *taken;
}
}
