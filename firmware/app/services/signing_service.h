// SPDX-License-Identifier: MIT
/// @file signing_service.h  SETUP_SIGNING (over a cable only), storage of the signing clock, and reports of rejected
/// frames.
#pragma once

#include "app/services/robot_state.h"

namespace omni {

class SigningService {
public:
    SigningService(Signing &signing, const Links &links, Texts &texts, const RobotClock &clock, const RobotState &robot)
        : signing_(signing), links_(links), texts_(texts), clock_(clock), robot_(robot) {}

    /// Load key and clock. Errors are reported once a link is connected.
    void boot();
    /// SETUP_SIGNING: set key and time; a key of zeros removes the key. Refused from a radio and while armed.
    void on_setup(const Frame &frame, const Sender &sender);
    /// Advance and store the clock, report rejected frames.
    void serve();

private:
    void report_key();
    /// Reason to refuse a key, or nullptr.
    const char *obstacle(const Sender &sender, uint64_t time);
    void store_time_if_due();
    void report_refused();

    Signing &signing_;
    const Links &links_;
    Texts &texts_;
    const RobotClock &clock_;
    const RobotState &robot_;
    bool was_armed_ = false;
    uint64_t tried_us_ = 0; ///< last failure of the memory; 0: none
    bool damage_said_ = false;
    uint32_t said_others_ = 0;
    uint32_t said_ahead_ = 0;
    uint64_t last_text_us_ = 0;
};

} // namespace omni
