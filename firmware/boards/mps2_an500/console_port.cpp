// SPDX-License-Identifier: MIT
#include "boards/mps2_an500/console_port.h"

#include <algorithm>
#include <cstring>

#include "boards/mps2_an500/base/semihosting.h"

namespace omni {

bool ConsolePort::open(bool radio) {
    is_radio_ = radio;
    in_ = an500::semihosting_open_console(true);
    out_ = an500::semihosting_open_console(false);
    return in_ >= 0 && out_ >= 0;
}

void ConsolePort::wait() {
    const int count = an500::semihosting_read(in_, bytes_, sizeof bytes_);
    if (count <= 0) {
        an500::semihosting_exit(0);
    }
    filled_ = static_cast<size_t>(count);
    taken_ = 0;
}

size_t ConsolePort::read(uint8_t *data, size_t capacity) {
    const size_t count = std::min(capacity, filled_ - taken_);
    std::memcpy(data, bytes_ + taken_, count);
    taken_ += count;
    return count;
}

bool ConsolePort::has_sent() {
    const bool sent = sent_;
    sent_ = false;
    return sent;
}

bool ConsolePort::write(const uint8_t *data, size_t length) {
    sent_ = true;
    return length <= most_ && an500::semihosting_write(out_, data, length) == static_cast<int>(length);
}

} // namespace omni
