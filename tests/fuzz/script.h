// SPDX-License-Identifier: MIT
/// @file script.h  A fuzzer's input read as a script: what runs out reads as zeros, so every input means something.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace fuzz {

class Script {
public:
    Script(const uint8_t *data, size_t size) : data_(data), size_(size) {}

    bool ended() const { return at_ >= size_; }
    uint8_t byte() { return at_ < size_ ? data_[at_++] : uint8_t{0}; }
    /// 0..count-1.
    size_t below(size_t count) { return count > 256 ? (byte() | static_cast<size_t>(byte()) << 8) % count : byte() % count; }
    bool one_in(size_t count) { return below(count) == count - 1; }
    template <class Number>
    Number number() {
        Number value{};
        bytes(&value, sizeof value);
        return value;
    }
    void bytes(void *to, size_t count) {
        const size_t have = count < size_ - at_ ? count : size_ - at_;
        if (have > 0) {
            std::memcpy(to, data_ + at_, have);
        }
        std::memset(static_cast<uint8_t *>(to) + have, 0, count - have);
        at_ += have;
    }

private:
    const uint8_t *data_;
    size_t size_;
    size_t at_ = 0;
};

} // namespace fuzz
