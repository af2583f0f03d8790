// SPDX-License-Identifier: MIT
#include "app/link/legacy_line.h"

#include <cstring>

#include "app/base/core.h"

namespace omni {
namespace {

constexpr size_t most_numbers = 6;
constexpr int max_exponent = 30;
/// Digits beyond the resolution of a float are ignored.
constexpr uint32_t mantissa_limit = 100'000'000;

/// Parser of a line.
struct Cursor {
    const char *at;
    const char *end;

    bool done() const { return at == end; }
    bool take(char wanted) {
        const bool here = at != end && *at == wanted;
        at += here ? 1 : 0;
        return here;
    }
    bool digit(uint32_t *value) {
        if (at == end || *at < '0' || *at > '9') {
            return false;
        }
        *value = static_cast<uint32_t>(*at++ - '0');
        return true;
    }
    void skip_blanks() {
        while (take(' ') || take('\t')) {}
    }
};

struct Decimal {
    uint32_t mantissa = 0;
    int exponent = 0;
    bool any = false;

    void add(uint32_t digit, bool fraction) {
        any = true;
        if (mantissa < mantissa_limit) {
            mantissa = mantissa * 10 + digit;
            exponent -= fraction ? 1 : 0;
        } else {
            exponent += fraction ? 0 : 1;
        }
    }
};

bool take_exponent(Cursor *cursor, int *exponent) {
    if (!cursor->take('e') && !cursor->take('E')) {
        return true;
    }
    const bool minus = cursor->take('-');
    if (!minus) {
        cursor->take('+');
    }
    uint32_t digit = 0;
    int value = 0;
    int digits = 0;
    for (; cursor->digit(&digit); ++digits) {
        value = value < 1000 ? value * 10 + static_cast<int>(digit) : value;
    }
    *exponent += minus ? -value : value;
    return digits > 0;
}

bool take_number(Cursor *cursor, omni_real_t *value) {
    cursor->skip_blanks();
    const bool minus = cursor->take('-');
    if (!minus) {
        cursor->take('+');
    }
    Decimal decimal;
    uint32_t digit = 0;
    while (cursor->digit(&digit)) {
        decimal.add(digit, false);
    }
    if (cursor->take('.')) {
        while (cursor->digit(&digit)) {
            decimal.add(digit, true);
        }
    }
    if (!decimal.any || !take_exponent(cursor, &decimal.exponent) || decimal.exponent > max_exponent) {
        return false;
    }
    cursor->skip_blanks();
    auto result = static_cast<omni_real_t>(decimal.mantissa);
    for (int i = 0; i < decimal.exponent; ++i) {
        result *= 10.0f;
    }
    for (int i = 0; i > decimal.exponent && result != 0.0f; --i) {
        result /= 10.0f;
    }
    *value = minus ? -result : result;
    return omni_is_finite(*value);
}

bool belongs_to_line(uint8_t byte) {
    return (byte >= '0' && byte <= '9') || (byte != 0 && std::strchr("+-.,eE \t", byte) != nullptr);
}

} // namespace

size_t parse_legacy_line(const char *text, size_t length, LegacySetpoint *setpoint) {
    omni_real_t numbers[most_numbers] = {};
    Cursor cursor = {text, text + length};
    size_t count = 0;
    do {
        if (count == most_numbers || !take_number(&cursor, &numbers[count])) {
            return 0;
        }
        ++count;
    } while (cursor.take(','));
    if (!cursor.done() || (count != most_numbers && count != most_numbers / 2)) {
        return 0;
    }
    setpoint->pose = {numbers[0], numbers[1], numbers[2]};
    setpoint->rate = {numbers[3], numbers[4], numbers[5]};
    return count;
}

void LegacyLine::set_on(bool on) {
    if (on != on_) {
        on_ = on;
        length_ = 0;
        calibration_disturbed_ = false;
        waiting_ = false;
        numbers_ = 0;
    }
}

void LegacyLine::spoil() {
    length_ = 0;
    calibration_disturbed_ = true;
}

void LegacyLine::end_line() {
    LegacySetpoint setpoint;
    const size_t numbers = calibration_disturbed_ ? 0 : parse_legacy_line(text_, length_, &setpoint);
    const bool good = numbers != 0 && numbers == numbers_;
    numbers_ = numbers != 0 ? numbers : numbers_;
    latest_ = good ? setpoint : latest_;
    waiting_ = good || waiting_;
    refused_ += good ? 0 : 1;
    length_ = 0;
    calibration_disturbed_ = false;
}

bool LegacyLine::on_byte(uint8_t byte) {
    if (!on_) {
        return false;
    }
    if (byte == '*') {
        end_line();
        return true;
    }
    if (byte == '\r' || byte == '\n') {
        if (length_ > 0) {
            spoil(); // invalid end of a line: discard up to the next `*`
        }
        return true;
    }
    if (!belongs_to_line(byte) || length_ == capacity) {
        spoil();
        return false;
    }
    text_[length_] = static_cast<char>(byte);
    length_ += calibration_disturbed_ ? 0 : 1;
    return true;
}

/// A frame within a line: discard the incomplete line.
void LegacyLine::on_frame() {
    refused_ += length_ > 0 || calibration_disturbed_ ? 1 : 0;
    length_ = 0;
    calibration_disturbed_ = false;
}

bool LegacyLine::take(LegacySetpoint *setpoint) {
    const bool there = waiting_;
    waiting_ = false;
    *setpoint = latest_;
    return there;
}

} // namespace omni
