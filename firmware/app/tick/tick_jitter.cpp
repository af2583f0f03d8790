// SPDX-License-Identifier: MIT
#include "app/tick/tick_jitter.h"

#include <algorithm>
#include <limits>

namespace omni {

void TickJitter::record_start(uint64_t now_ns) {
    if (!begun_) {
        begun_ = true;
        due_ns_ = now_ns;
    }
    const auto late_ns = static_cast<int64_t>(now_ns - due_ns_);
    earliest_ns_ = std::min(earliest_ns_, late_ns);
    latest_ns_ = std::max(latest_ns_, late_ns);
    const int64_t missed = std::max<int64_t>(late_ns, 0) / period_ns;
    due_ns_ += static_cast<uint64_t>((missed + 1) * period_ns);
    if (++count_ < window_ticks) {
        return;
    }
    max_us_ = static_cast<float>(latest_ns_ - earliest_ns_) * 1e-3f;
    // The earliest start sets the grid of the next window, so that two clocks that drift apart do not look like jitter.
    due_ns_ += static_cast<uint64_t>(earliest_ns_);
    count_ = 0;
    earliest_ns_ = std::numeric_limits<int64_t>::max();
    latest_ns_ = std::numeric_limits<int64_t>::min();
}

} // namespace omni
