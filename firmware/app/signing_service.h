// SPDX-License-Identifier: MIT
/// @file signing_service.h  The signing key's way in (SETUP_SIGNING, over USB only), keeping its clock, and saying what was refused.
#pragma once

#include "app/shared.h"

namespace omni {

class SigningService {
public:
    explicit SigningService(Shared &shared) : shared_(shared) {}

    /// Key and clock from the memory. What is wrong with them is said once somebody listens.
    void boot();
    /// A key of zeros removes the key. Refused from a radio and while armed.
    void on_setup(const Frame &frame, const Sender &sender);
    /// Let the clock go on, store it, say what was refused.
    void serve();

private:
    void say_key();
    void keep_time();
    void say_refused();

    Shared &shared_;
    bool was_armed_ = false;
    bool store_failed_ = false;
    bool damage_said_ = false;
    uint32_t said_refused_ = 0;
    uint64_t said_us_ = 0;
};

} // namespace omni
