// SPDX-License-Identifier: MIT
/// @file status_texts.h  Says what changes: safety state, faults, end of a trajectory.
#pragma once

#include "app/shared.h"

namespace omni {

class StatusTexts {
public:
    explicit StatusTexts(Shared &shared) : shared_(shared) {}
    /// Compare the latest tick with what was said last.
    void serve();
    void restart();
    /// Somebody has come to this link: what stops the robot is news there.
    void greet(size_t link) { button_said_[link] = false; }

private:
    void say_state(uint8_t state);
    void say_links();
    void say_button();

    Shared &shared_;
    uint8_t state_ = OMNI_STATE_INIT;
    uint8_t phase_ = OMNI_PHASE_NONE;
    uint32_t history_ = 0;
    bool button_said_[Board::max_ports] = {};
};

} // namespace omni
