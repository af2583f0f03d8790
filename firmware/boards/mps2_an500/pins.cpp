// SPDX-License-Identifier: MIT
#include "boards/mps2_an500/pins.h"

#include <algorithm>
#include <cstring>

#include "boards/mps2_an500/base/semihosting.h"

namespace omni {
namespace {

/// Output record; the host reads it as little-endian and packed.
struct Out {
    uint64_t time_us;
    uint8_t enabled;
    uint8_t i2c_length;
    uint8_t sent_length;
    uint8_t sent[WirePort::bytes_per_tick];
    uint8_t i2c[128 + 1];
};
static_assert(sizeof(Out) == 152, "no padding");

/// Input record.
struct In {
    int32_t counts[4];
    float battery_V;
    uint8_t counts_valid;
    uint8_t i2c_status;
    uint8_t i2c_read[8];
    uint8_t received_length;
    uint8_t received[WirePort::bytes_per_tick];
    uint8_t stop_button;
};
static_assert(sizeof(In) == 44, "no padding");

} // namespace

size_t WirePort::read(uint8_t *data, size_t capacity) {
    size_t count = 0;
    while (count < capacity && in_.used() > 0) {
        data[count++] = in_.take();
    }
    return count;
}

bool WirePort::write(const uint8_t *data, size_t length) {
    if (length > out_.free()) {
        return false;
    }
    for (size_t i = 0; i < length; ++i) {
        out_.put(data[i]);
    }
    return true;
}

size_t WirePort::take_sent(uint8_t *data) {
    size_t count = 0;
    while (count < bytes_per_tick && out_.used() > 0) {
        data[count++] = out_.take();
    }
    return count;
}

void WirePort::put_received(const uint8_t *data, size_t length) {
    for (size_t i = 0; i < length && in_.free() > 0; ++i) {
        in_.put(data[i]);
    }
}

bool Pins::connect() {
    in_ = an500::semihosting_open_console(true);
    out_ = an500::semihosting_open_console(false);
    return in_ >= 0 && out_ >= 0;
}

uint8_t Pins::read(int32_t *counts) {
    Out out{};
    out.time_us = clock_->now_us();
    out.enabled = enabled_;
    out.i2c_length = bus.take(out.i2c);
    out.sent_length = static_cast<uint8_t>(wire.take_sent(out.sent));
    an500::semihosting_write(out_, &out, sizeof out);
    In in{};
    for (size_t filled = 0; filled < sizeof in;) {
        const int count = an500::semihosting_read(in_, reinterpret_cast<uint8_t *>(&in) + filled, sizeof in - filled);
        if (count <= 0) {
            an500::semihosting_exit(0); // the host has closed the connection
        }
        filled += static_cast<size_t>(count);
    }
    bus.answer(in.i2c_status, in.i2c_read);
    wire.put_received(in.received, std::min<size_t>(in.received_length, WirePort::bytes_per_tick));
    battery_V_ = in.battery_V;
    button_open_ = in.stop_button != 0;
    std::memcpy(counts, in.counts, sizeof in.counts);
    return in.counts_valid;
}

void Pins::errors(uint32_t *errors) {
    std::fill(errors, errors + OMNI_MAX_WHEELS, 0u);
}

} // namespace omni
