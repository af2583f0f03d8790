// SPDX-License-Identifier: MIT
// Takes the place of the board's header of the same name.
#pragma once

namespace omni {

struct InterruptLock {
    InterruptLock();
    ~InterruptLock();
    InterruptLock(const InterruptLock &) = delete;
    InterruptLock &operator=(const InterruptLock &) = delete;
};

} // namespace omni
