// SPDX-License-Identifier: MIT
#include "chip.h"

#include <cstring>

#include "check.h"

namespace fuzz {
namespace {

constexpr uint8_t mode1 = 0x00;
constexpr uint8_t led0 = 0x06;
constexpr uint8_t led_end = 0x46;
constexpr uint8_t all_led = 0xFA;
constexpr uint8_t prescale = 0xFE;
constexpr uint8_t test_mode = 0xFF;
constexpr uint8_t sleep = 0x10;
constexpr uint8_t full = 0x10;

unsigned twelve_bits(const uint8_t *low) {
    return low[0] | (low[1] & 0x0Fu) << 8;
}

} // namespace

void Chip::power_up() {
    std::memset(registers_, 0, sizeof registers_);
    registers_[mode1] = 0x11;
    registers_[1] = 0x04;
    for (size_t channel = 0; channel < channels; ++channel) {
        registers_[led0 + 4 * channel + 3] = full;
    }
    registers_[prescale] = 0x1E;
}

void Chip::transact(uint8_t address, const uint8_t *write, size_t length, uint8_t *read, size_t read_length) {
    if (length == 0 && read_length == 0) {
        return; // somebody looks who is there
    }
    check(address == Chip::address, "only the PWM chip is spoken to", address);
    check(length >= 1 && length <= omni::I2cTransaction::max_write, "a transaction begins with a register",
          static_cast<long>(length));
    uint8_t pointer = write[0];
    for (size_t i = 1; i < length; ++i, ++pointer) {
        check(pointer < led_end || (pointer >= all_led && pointer != test_mode), "only existing registers are written",
              pointer);
        check(pointer != prescale || (registers_[mode1] & sleep) != 0, "the prescaler is set while the chip sleeps");
        registers_[pointer] = write[i];
        if (pointer >= all_led && pointer < prescale) {
            for (size_t channel = 0; channel < channels; ++channel) {
                registers_[led0 + 4 * channel + (pointer - all_led)] = write[i];
            }
        }
    }
    for (size_t i = 0; i < read_length; ++i) {
        read[i] = registers_[pointer++];
    }
    check_outputs();
}

unsigned Chip::high_steps(size_t channel) const {
    const uint8_t *at = registers_ + led0 + 4 * channel;
    if ((registers_[mode1] & sleep) != 0 || (at[3] & full) != 0) {
        return 0;
    }
    return (at[1] & full) != 0 ? 4096 : (twelve_bits(at + 2) - twelve_bits(at)) & 0x0FFFu;
}

bool Chip::all_off() const {
    for (size_t channel = 0; channel < channels; ++channel) {
        if (high_steps(channel) != 0) {
            return false;
        }
    }
    return true;
}

void Chip::check_outputs() const {
    for (size_t channel = 0; channel < channels; ++channel) {
        const uint8_t *at = registers_ + led0 + 4 * channel;
        check(((at[1] | at[3]) & full) != 0 || twelve_bits(at) != twelve_bits(at + 2), "ON and OFF are never equal",
              static_cast<long>(channel));
    }
}

} // namespace fuzz
