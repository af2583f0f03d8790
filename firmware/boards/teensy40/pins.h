// SPDX-License-Identifier: MIT
/// @file pins.h  The PWM chip's output-enable pin and the lamp.
#pragma once

#include <cstdint>

#include "app/board.h"

namespace omni {

/// Active low; a pull-up keeps it off while the processor does not drive it: in reset, and until startup_middle_hook().
class Teensy40OutputEnable final : public OutputEnable {
public:
    /// Drive the pin to off, without a moment of on, and let the fault handlers do so too.
    void begin();
    bool wired() override;
    void set(bool on) override;
    void release() override;

private:
    bool released_ = false;
};

class Teensy40Light final : public StatusLight {
public:
    void begin();
    void set(bool on) override;
};

} // namespace omni
