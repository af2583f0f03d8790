// SPDX-License-Identifier: MIT
/// @file button_watch.h  The stop buttons: the robot's own, and the simulated robot's while a host is in the loop.
#pragma once

#include <atomic>

#include "app/base/board.h"
#include "app/tick/control_loop.h"

namespace omni {

class ButtonWatch {
public:
    /// @param button of the board; nullptr: none.
    ButtonWatch(StopButton *button, ControlLoop &control) : button_(button), control_(control) {}

    /// From the tick: an emergency stop if the robot's own button is open, whatever else goes on. The first open sample
    /// stops (docs/reference/safety.md says why).
    void look() { stop_if(own_open()); }
    /// The same for the simulated robot's. Background. @param open as its world shows it.
    void look_simulated(bool open) {
        simulated_open_ = open;
        stop_if(open);
    }
    /// The simulated robot has gone, or starts over.
    void forget_simulated() { simulated_open_ = false; }
    /// A button is open now.
    bool open() const { return simulated_open_ || own_open(); }
    /// A button was seen open since the last release.
    bool pressed() const { return pressed_.load(std::memory_order_relaxed); }
    /// The emergency stop is being released.
    void release() { pressed_.store(false, std::memory_order_relaxed); }

private:
    bool own_open() const { return button_ != nullptr && button_->open(); }
    void stop_if(bool open) {
        if (open) {
            pressed_.store(true, std::memory_order_relaxed);
            control_.stop(OMNI_EVENT_ESTOP);
        }
    }

    StopButton *const button_;
    ControlLoop &control_;
    std::atomic<bool> pressed_{false};
    bool simulated_open_ = false;
};

} // namespace omni
