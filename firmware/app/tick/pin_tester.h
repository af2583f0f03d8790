// SPDX-License-Identifier: MIT
/// @file pin_tester.h  Test of the output-enable pin: switch it off without bus traffic, so that the PWM chip keeps its
/// last duties; then disarm.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "app/base/board.h"
#include "app/base/core.h"

namespace omni {

class PinTester {
public:
    static constexpr float max_duty = 0.3f; ///< maximum duty at the start; requires open-loop duties
    static constexpr float min_s = 0.1f;
    static constexpr float max_s = 2.0f;

    void restart() { ticks_left_ = 0; }
    /// Background: set the test for begin(). @param release make the pin high impedance, to test its pull-up; false:
    /// drive it to off.
    void request(uint32_t ticks, bool release) {
        wanted_.store(ticks * 2 + (release ? 1 : 0), std::memory_order_relaxed);
    }
    /// Tick: begin the requested test. Requires small open-loop duties: a closed loop would raise them while the wheels
    /// do not respond. A retransmission has no effect.
    /// @return false if the duties have increased since the request was accepted: disarm, as at the end of a test.
    bool begin(const omni_outputs_t &outputs, size_t wheels);
    /// Tick, before the core.
    void prepare(omni_inputs_t &inputs, const omni_limits_t &limits) {
        if (ticks_left_ != 0) {
            count_tick(inputs, limits.command_timeout_s);
        }
    }
    /// Tick, in place of the motor driver. @return false if no test is active: a stop ends it and reaches the bus in
    /// the same tick.
    bool run(OutputEnable &pin, bool drive) { return ticks_left_ != 0 && hold(pin, drive); }

private:
    void count_tick(omni_inputs_t &inputs, float timeout_s);
    bool hold(OutputEnable &pin, bool drive);

    std::atomic<uint32_t> wanted_{0}; ///< ticks * 2 + release
    uint32_t ticks_left_ = 0;         ///< 0: no test
    bool release_ = false;
};

} // namespace omni
