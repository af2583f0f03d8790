// SPDX-License-Identifier: MIT
/// @file script.h  A fuzzer's input read as a script: what runs out reads as zeros, so every input means something.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

namespace fuzz {

/// 0..count-1: the entry whose identity(i), a number of its own, goes best with the draw. A new entry takes over its
/// share of the draws and leaves all others as they were. So inputs that were kept before still mean the same.
template <class Identity>
size_t entry_for(uint32_t draw, size_t count, Identity identity) {
    size_t best = 0;
    uint32_t best_rank = 0;
    for (size_t i = 0; i < count; ++i) {
        uint32_t rank = (draw + 1) * 0x9E3779B1u ^ static_cast<uint32_t>(identity(i)) * 0x85EBCA6Bu;
        rank = (rank ^ rank >> 15) * 0x2C1B3C6Du;
        rank = (rank ^ rank >> 12) * 0x297A2D39u;
        rank ^= rank >> 15;
        if (i == 0 || rank > best_rank) {
            best = i;
            best_rank = rank;
        }
    }
    return best;
}

class Script {
public:
    Script(const uint8_t *data, size_t size) : data_(data), size_(size) {}

    bool ended() const { return at_ >= size_; }
    uint8_t byte() { return at_ < size_ ? data_[at_++] : uint8_t{0}; }
    /// 0..count-1.
    size_t below(size_t count) {
        return count > 256 ? (byte() | static_cast<size_t>(byte()) << 8) % count : byte() % count;
    }
    /// 0..count-1, as entry_for() says.
    template <class Identity>
    size_t entry(size_t count, Identity identity) {
        return entry_for(number<uint16_t>(), count, identity);
    }
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
