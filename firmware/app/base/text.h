// SPDX-License-Identifier: MIT
/// @file text.h  Text builder for STATUSTEXT, without heap and printf.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <initializer_list>

namespace omni {

/// A byte as two hexadecimal digits.
struct HexByte {
    uint8_t value;
};

/// Text of at most 50 characters (one STATUSTEXT), truncated. Not inlined, to save fast memory: texts have no deadline.
class Text {
public:
    static constexpr size_t capacity = 50;

    [[gnu::noinline]] Text &add(const char *text) {
        while (*text != '\0' && length_ < capacity) {
            buffer_[length_++] = *text++;
        }
        return *this;
    }
    [[gnu::noinline]] Text &add(uint32_t number) {
        char digits[11];
        size_t at = sizeof digits;
        digits[--at] = '\0';
        do {
            digits[--at] = static_cast<char>('0' + number % 10);
            number /= 10;
        } while (number != 0);
        return add(digits + at);
    }
    /// Eight digits after 0x.
    [[gnu::noinline]] Text &add_hex(uint32_t number) {
        char digits[11] = "0x00000000";
        for (size_t at = 9; number != 0; --at, number >>= 4) {
            digits[at] = "0123456789ABCDEF"[number & 0xF];
        }
        return add(digits);
    }
    /// With up to four decimals below 100000; huge and non-finite values are named instead.
    [[gnu::noinline]] Text &add(float value) {
        if (!(value == value)) {
            return add("NaN");
        }
        if (value < 0.0f) {
            add("-");
            value = -value;
        }
        if (value >= 4.0e9f) {
            return add(value > 3.4e38f ? "infinity" : "huge");
        }
        if (value >= 1.0e5f) {
            return add(static_cast<uint32_t>(value));
        }
        const auto scaled = static_cast<uint32_t>(std::lround(value * 10000.0f));
        add(scaled / 10000);
        uint32_t rest = scaled % 10000;
        if (rest != 0) {
            add(".");
            for (const uint32_t place : {1000u, 100u, 10u, 1u}) {
                if (rest != 0) {
                    add(rest / place);
                    rest %= place;
                }
            }
        } else if (scaled == 0 && value > 0.0f) {
            add(".0000");
        }
        return *this;
    }
    Text &add(HexByte byte) {
        const char *digits = "0123456789ABCDEF";
        const char written[] = {'0', 'x', digits[byte.value >> 4], digits[byte.value & 0xF], '\0'};
        return add(written);
    }
    /// Add a pattern in which each `#` stands for the next number.
    template <class Number>
    [[gnu::noinline]] Text &fill(const char *pattern, const Number *numbers) {
        for (; *pattern != '\0'; ++pattern) {
            const char letter[] = {*pattern, '\0'};
            *pattern == '#' ? add(*numbers++) : add(letter);
        }
        return *this;
    }
    const char *data() const { return buffer_; }
    size_t length() const { return length_; }

private:
    char buffer_[capacity + 1] = {};
    size_t length_ = 0;
};

} // namespace omni
