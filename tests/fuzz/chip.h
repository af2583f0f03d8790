// SPDX-License-Identifier: MIT
/// @file chip.h  The PWM chip on the bus as the datasheet has it, to see what the motors would get.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"

namespace fuzz {

/// PCA9685: takes transactions, checks that they are ones its driver may send, and knows every output.
class Chip {
public:
    /// A new chip after power-up: asleep, everything full-off.
    void power_up();
    /// One transaction. @param write register pointer, then values. @param read filled with read_length bytes.
    void transact(uint8_t address, const uint8_t *write, size_t length, uint8_t *read, size_t read_length);
    /// Of 4096 steps, how many this output is high.
    unsigned high_steps(size_t channel) const;
    bool all_off() const;
    /// Outputs are seen to be whole: never ON == OFF without a full bit.
    void check_outputs() const;

    static constexpr size_t channels = 16;
    static constexpr uint8_t address = 0x40;

private:
    uint8_t registers_[256] = {};
};

} // namespace fuzz
