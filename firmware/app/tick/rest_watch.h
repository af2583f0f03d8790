// SPDX-License-Identifier: MIT
/// @file rest_watch.h  Detects a robot at rest, by its wheels.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/core.h"

namespace omni {

class RestWatch {
public:
    /// Once per tick. @param counts of OMNI_MAX_WHEELS encoders. @param now_us robot clock.
    /// @return true: no wheel has moved since the start, or for rest_us.
    bool update(const int32_t *counts, uint64_t now_us) {
        bool moved = false;
        for (size_t i = 0; i < OMNI_MAX_WHEELS; ++i) {
            const uint32_t travel = static_cast<uint32_t>(counts[i]) - static_cast<uint32_t>(at_[i]);
            moved = moved || travel + flicker > 2 * flicker;
        }
        if (moved || !begun_) {
            for (size_t i = 0; i < OMNI_MAX_WHEELS; ++i) {
                at_[i] = counts[i];
            }
            since_us_ = now_us;
            moved_ = moved_ || begun_;
            begun_ = true;
        }
        return !moved_ || now_us - since_us_ >= rest_us;
    }

private:
    static constexpr uint64_t rest_us = 1'000'000;
    static constexpr uint32_t flicker = 2; ///< tolerance for encoder jitter at rest [counts]

    int32_t at_[OMNI_MAX_WHEELS] = {};
    uint64_t since_us_ = 0;
    bool begun_ = false;
    bool moved_ = false;
};

} // namespace omni
