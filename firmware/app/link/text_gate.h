// SPDX-License-Identifier: MIT
/// @file text_gate.h  How many texts a link is told: a burst, then one per interval. Twenty refusals a second would
/// fill a slow radio, and one line of them is as good. So what is left out is counted, and can be said.
#pragma once

#include <algorithm>
#include <cstdint>

namespace omni {

class TextGate {
public:
    static constexpr uint32_t burst = 10;
    /// Of these, for a text that is not the last one again: after many "not ready" comes the true reason.
    static constexpr uint32_t reserve = 2;

    /// @param interval_us time after which one more text may go.
    explicit TextGate(uint64_t interval_us) : interval_us_(interval_us) {}

    /// Whether a text may go now; it counts as sent, or as left out. @param sum a checksum that tells texts apart.
    bool pass(uint64_t now_us, uint32_t sum) {
        refill(now_us);
        const bool again = sum == last_sum_;
        last_sum_ = sum;
        if (again ? left_ <= reserve || left_out_ > 0 : left_ == 0) {
            ++left_out_;
            return false;
        }
        --left_;
        return true;
    }
    /// Texts that did not go for another reason.
    void count(uint32_t number = 1) { left_out_ += number; }
    /// How many were left out, once it may be said; 0: none, or not yet.
    uint32_t take_left_out(uint64_t now_us) {
        refill(now_us);
        if (left_out_ == 0 || left_ <= reserve) {
            return 0;
        }
        --left_;
        const uint32_t number = left_out_;
        left_out_ = 0;
        return number;
    }

private:
    void refill(uint64_t now_us) {
        if (now_us < refilled_us_ || left_ == burst) {
            refilled_us_ = now_us; // a clock that starts over starts a new account
        }
        const uint64_t more = (now_us - refilled_us_) / interval_us_;
        refilled_us_ += more * interval_us_;
        left_ = static_cast<uint32_t>(std::min<uint64_t>(left_ + more, burst));
    }

    uint64_t interval_us_;
    uint64_t refilled_us_ = 0;
    uint32_t left_ = burst;
    uint32_t left_out_ = 0;
    uint32_t last_sum_ = 0; ///< of the text that was last to go, sent or not
};

} // namespace omni
