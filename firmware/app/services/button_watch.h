// SPDX-License-Identifier: MIT
/// @file button_watch.h  Stop buttons: the robot's, and the simulated robot's in hardware-in-the-loop.
#pragma once

#include <atomic>

#include "app/base/board.h"
#include "app/tick/control_loop.h"

namespace omni {

class ButtonWatch {
public:
    /// @param button of the board; nullptr: none.
    ButtonWatch(StopButton *button, ControlLoop &control) : button_(button), control_(control) {}

    /// Tick: e-stop if the robot's button is open. Not debounced: the first open sample stops
    /// (docs/reference/safety.md).
    void check() { stop_if_open(own_open()); }
    /// Background: e-stop if the simulated robot's button is open. @param open state in the simulated world.
    void check_simulated(bool open) {
        simulated_open_ = open;
        stop_if_open(open);
    }
    /// Reset the simulated button at the end or a restart of the simulation.
    void reset_simulated() { simulated_open_ = false; }
    /// Is a button open now?
    bool open() const { return simulated_open_ || own_open(); }
    /// Has a button been open since the last release?
    bool pressed() const { return pressed_.load(std::memory_order_relaxed); }
    /// Clear `pressed()` on release of the e-stop.
    void release() { pressed_.store(false, std::memory_order_relaxed); }

private:
    bool own_open() const { return button_ != nullptr && button_->open(); }
    void stop_if_open(bool open) {
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
