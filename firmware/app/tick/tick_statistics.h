// SPDX-License-Identifier: MIT
/// @file tick_statistics.h  Figures of the ticks: their duration, and the integral of the motor voltages.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "app/base/core.h"

namespace omni {

/// Duration of ticks, in windows.
class TickDuration {
public:
    void record(uint64_t duration_ns) {
        last_ns_ = static_cast<uint32_t>(duration_ns);
        sum_ns_ += duration_ns;
        longest_ns_ = std::max(longest_ns_, duration_ns);
        if (++count_ == window_ticks) {
            mean_us_ = static_cast<float>(sum_ns_) * 1e-3f / static_cast<float>(window_ticks);
            max_us_ = static_cast<float>(longest_ns_) * 1e-3f;
            count_ = 0;
            sum_ns_ = 0;
            longest_ns_ = 0;
        }
    }
    uint32_t last_ns() const { return last_ns_; }
    /// Mean and maximum of the last complete window; 0 until there is one.
    float mean_us() const { return mean_us_; }
    float max_us() const { return max_us_; }

private:
    static constexpr uint32_t window_ticks = 1000;
    uint32_t count_ = 0;
    uint64_t sum_ns_ = 0;
    uint64_t longest_ns_ = 0;
    uint32_t last_ns_ = 0;
    float mean_us_ = 0.0f;
    float max_us_ = 0.0f;
};

/// Integral of each motor's voltage [1e-6 V s], modulo 2^32.
class VoltageIntegral {
public:
    /// Add the voltages of this tick, which act until the next one.
    void add(const omni_real_t *voltage_V, size_t wheels) {
        for (size_t i = 0; i < wheels; ++i) {
            const float volt_us = voltage_V[i] * static_cast<float>(OMNI_TICK_US);
            if (std::abs(volt_us) <= most_volt_us) {
                volt_us_[i] += static_cast<uint32_t>(std::lround(volt_us));
            }
        }
    }
    /// OMNI_MAX_WHEELS entries.
    const uint32_t *volt_us() const { return volt_us_; }

private:
    /// Limit of |voltage| per tick [1e-6 V s]: larger values, possible only from a simulator, are ignored to prevent an
    /// overflow of the conversion.
    static constexpr float most_volt_us = 1e9f;
    uint32_t volt_us_[OMNI_MAX_WHEELS] = {};
};

} // namespace omni
