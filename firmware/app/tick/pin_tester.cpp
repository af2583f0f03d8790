// SPDX-License-Identifier: MIT
#include "app/tick/pin_tester.h"

#include <algorithm>
#include <cmath>

namespace omni {

bool PinTester::begin(const omni_outputs_t &outputs, size_t wheels) {
    if (ticks_left_ != 0 || !outputs.drive) {
        return true;
    }
    const auto is_large = [](omni_real_t duty) { return !(std::abs(duty) <= max_duty); };
    if (outputs.setpoint_kind != OMNI_SETPOINT_DUTY || std::any_of(outputs.duty, outputs.duty + wheels, is_large)) {
        return false;
    }
    const uint32_t wanted = wanted_.load(std::memory_order_relaxed);
    ticks_left_ = wanted / 2;
    release_ = wanted % 2 != 0;
    return true;
}

/// During the test the core gets the actual duties, 0, so that no stall is detected and no voltage is integrated. A
/// stream of zeros cannot time out, so the timeout of the sender's duties is checked here. It ends the test.
void PinTester::count_tick(omni_inputs_t &inputs, float timeout_s) {
    std::fill(inputs.setpoint.duty, inputs.setpoint.duty + OMNI_MAX_WHEELS, 0.0f);
    --ticks_left_;
    const bool timed_out = inputs.time_us > inputs.setpoint.time_us + static_cast<uint64_t>(timeout_s * 1e6f);
    if (ticks_left_ == 0 || timed_out || inputs.setpoint.kind != OMNI_SETPOINT_DUTY) {
        ticks_left_ = 0;
        inputs.events |= OMNI_EVENT_DISARM;
    }
}

bool PinTester::hold(OutputEnable &pin, bool drive) {
    if (!drive) {
        ticks_left_ = 0;
        return false;
    }
    if (release_) {
        pin.release();
    } else {
        pin.set(false);
    }
    return true;
}

} // namespace omni
