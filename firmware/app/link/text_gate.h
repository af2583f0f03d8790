// SPDX-License-Identifier: MIT
/// @file text_gate.h  Rate limiter of STATUSTEXT (token bucket): a burst, then one per interval. Suppressed texts are
/// counted and reported. Why: refusals of setpoints at 20 Hz would fill a slow radio.
#pragma once

#include <algorithm>
#include <cstdint>

namespace omni {

class TextGate {
public:
    static constexpr uint32_t burst = 10;
    /// Tokens reserved for a text that differs from the last one.
    static constexpr uint32_t reserve = 2;

    /// @param interval_us refill interval of one token.
    explicit TextGate(uint64_t interval_us) : interval_us_(interval_us) {}

    /// May a text be sent now? Counts it as sent or suppressed. @param sum checksum of the text.
    bool pass(uint64_t now_us, uint32_t sum) {
        refill(now_us);
        const bool again = sum == last_sum_;
        last_sum_ = sum;
        if (again ? left_ <= reserve || suppressed_ > 0 : left_ == 0) {
            ++suppressed_;
            return false;
        }
        --left_;
        return true;
    }
    /// Count texts suppressed for another reason.
    void count(uint32_t number = 1) { suppressed_ += number; }
    /// Number of suppressed texts, when it may be reported; 0: none, or not yet.
    uint32_t take_suppressed_count(uint64_t now_us) {
        refill(now_us);
        if (suppressed_ == 0 || left_ <= reserve) {
            return 0;
        }
        --left_;
        const uint32_t number = suppressed_;
        suppressed_ = 0;
        return number;
    }

private:
    void refill(uint64_t now_us) {
        if (now_us < refilled_us_ || left_ == burst) {
            refilled_us_ = now_us; // the clock was restarted
        }
        const uint64_t more = (now_us - refilled_us_) / interval_us_;
        refilled_us_ += more * interval_us_;
        left_ = static_cast<uint32_t>(std::min<uint64_t>(left_ + more, burst));
    }

    uint64_t interval_us_;
    uint64_t refilled_us_ = 0;
    uint32_t left_ = burst;
    uint32_t suppressed_ = 0;
    uint32_t last_sum_ = 0; ///< checksum of the last text, sent or suppressed
};

} // namespace omni
