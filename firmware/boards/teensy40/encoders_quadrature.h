// SPDX-License-Identifier: MIT
/// @file encoders_quadrature.h  Counts a quadrature encoder from the levels of its channels: every edge is one count.
#pragma once

#include <cstdint>

namespace omni {

/// Channel A leads channel B: the count rises. Written by one interrupt, read from anywhere.
class QuadratureCounter {
public:
    /// Begin at 0 with the present levels. @param levels 2 A + B.
    void begin(uint8_t levels) {
        levels_ = levels;
        count_ = 0;
        errors_ = 0;
    }

    /// Take the levels after an edge. Both channels changed: an edge was missed or is noise, its direction unknown; the
    /// count stays and the error is counted.
    void update(uint8_t levels) {
        // Index: levels before, levels now. 2: illegal.
        static constexpr int8_t step[16] = {0, -1, 1, 2, 1, 0, 2, -1, -1, 2, 0, 1, 2, 1, -1, 0};
        const int8_t moved = step[levels_ * 4 + levels];
        levels_ = levels;
        if (moved == 2) {
            errors_ = errors_ + 1;
        } else {
            count_ = count_ + static_cast<uint32_t>(moved);
        }
    }

    /// Go on from the present levels after missed edges: the count stays, one error is counted. Not while
    /// update() may interrupt.
    void resume(uint8_t levels) {
        levels_ = levels;
        errors_ = errors_ + 1;
    }

    /// Wraps at 32 bits.
    int32_t count() const { return static_cast<int32_t>(count_); }
    uint32_t errors() const { return errors_; }

private:
    uint8_t levels_ = 0;
    volatile uint32_t count_ = 0;
    volatile uint32_t errors_ = 0;
};

} // namespace omni
