// SPDX-License-Identifier: MIT
/// @file pins.h  The PWM chip's output-enable pin, the stop button and the LED.
#pragma once

#include <cstdint>

#include "app/base/board.h"

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

/// Open reads high: by the pad's pull-up of 22 kOhm, with hysteresis (i.MX RT1060 reference manual, IOMUXC,
/// SW_PAD_CTL_PAD).
class Teensy40StopButton final : public StopButton {
public:
    static bool wired();
    /// The pull-up then takes microseconds to charge a wire, with 10 nF at the pin 0.3 ms: the first tick comes later.
    void begin();
    bool open() override;
};

class Teensy40Light final : public StatusLight {
public:
    void begin();
    void set(bool on) override;
};

} // namespace omni
