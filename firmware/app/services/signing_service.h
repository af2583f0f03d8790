// SPDX-License-Identifier: MIT
/// @file signing_service.h  The signing key's way in (SETUP_SIGNING, over a cable only), keeping its clock, and saying
/// what was refused.
#pragma once

#include "app/services/robot_state.h"

namespace omni {

class SigningService {
public:
    SigningService(Signing &signing, const Links &links, Texts &texts, const RobotClock &clock, const RobotState &robot)
        : signing_(signing), links_(links), texts_(texts), clock_(clock), robot_(robot) {}

    /// Key and clock from the memory. What is wrong with them is said once somebody listens.
    void boot();
    /// A key of zeros removes the key; any other brings the time, too. Refused from a radio and while armed.
    void on_setup(const Frame &frame, const Sender &sender);
    /// Let the clock go on, store it, say what was refused.
    void serve();

private:
    void say_key();
    /// @return nullptr, or why a key is not taken.
    const char *obstacle(const Sender &sender, uint64_t time);
    void keep_time();
    void say_refused();

    Signing &signing_;
    const Links &links_;
    Texts &texts_;
    const RobotClock &clock_;
    const RobotState &robot_;
    bool was_armed_ = false;
    uint64_t tried_us_ = 0; ///< when the memory failed last; 0: it did not
    bool damage_said_ = false;
    uint32_t said_others_ = 0;
    uint32_t said_ahead_ = 0;
    uint64_t said_us_ = 0;
};

} // namespace omni
