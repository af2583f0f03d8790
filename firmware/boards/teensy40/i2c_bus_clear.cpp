// SPDX-License-Identifier: MIT
#include "boards/teensy40/i2c_bus_clear.h"

namespace omni {

void I2cBusClear::begin() {
    clocks_ = 0;
    go(Phase::let_go, false, false);
}

void I2cBusClear::go(Phase phase, bool pull_scl, bool pull_sda) {
    phase_ = phase;
    pulls_scl_ = pull_scl;
    pulls_sda_ = pull_sda;
    waited_ = 0;
}

/// SCL is high and ours: another clock, the STOP, or give up.
I2cBusClear::Result I2cBusClear::check_sda(bool sda) {
    if (sda) {
        go(Phase::stop_low, true, false);
    } else if (clocks_ == clock_limit) {
        return Result::sda_stuck;
    } else {
        go(Phase::clock_low, true, false);
    }
    return Result::working;
}

I2cBusClear::Result I2cBusClear::step(bool scl, bool sda) {
    if (!pulls_scl_ && !scl) {
        return ++waited_ >= scl_timeout ? Result::scl_stuck : Result::working;
    }
    switch (phase_) {
    case Phase::let_go:
        return check_sda(sda);
    case Phase::clock_low:
        go(Phase::clock_high, false, false);
        return Result::working;
    case Phase::clock_high:
        ++clocks_;
        return check_sda(sda);
    case Phase::stop_low:
        go(Phase::stop_sda, true, true);
        return Result::working;
    case Phase::stop_sda:
        go(Phase::stop_high, false, true);
        return Result::working;
    case Phase::stop_high:
        go(Phase::stop_end, false, false);
        return Result::working;
    case Phase::stop_end:
        return sda ? Result::freed : Result::sda_stuck;
    }
    return Result::sda_stuck;
}

} // namespace omni
