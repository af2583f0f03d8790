// SPDX-License-Identifier: MIT
/// @file snapshot.h  Lock-free exchange between the tick (an interrupt) and the background. No side ever waits for the
/// other.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace omni {

/// Latest value, from one side to the other: three slots, of which each side owns one and the third is passed to and
/// fro.
template <class T>
class Snapshot {
public:
    /// Writer: fill this, then publish().
    T &writing() { return slots_[write_]; }
    void publish() { write_ = middle_.exchange(write_ | fresh, std::memory_order_acq_rel) & index_mask; }
    /// Reader: take the latest. @return false if nothing new was published; reading() then stays what it was.
    bool update() {
        if ((middle_.load(std::memory_order_acquire) & fresh) == 0) {
            return false;
        }
        read_ = middle_.exchange(read_, std::memory_order_acq_rel) & index_mask;
        return true;
    }
    const T &reading() const { return slots_[read_]; }

private:
    static constexpr uint8_t fresh = 0x80;
    static constexpr uint8_t index_mask = 0x03;
    T slots_[3] = {};
    uint8_t write_ = 0;
    uint8_t read_ = 1;
    std::atomic<uint8_t> middle_{2};
};

/// A large value that the background prepares and the tick then uses in place until it takes the next one. What is
/// published and not yet taken may be replaced or withdrawn.
template <class T>
class Handover {
public:
    /// Background: prepare the next value here.
    T &scratch() { return slots_[free_]; }
    /// Background: offer the scratch; the tick takes it at its next run.
    void publish() {
        const uint8_t offered = free_;
        settle(mailbox_.exchange(offered, std::memory_order_acq_rel));
        published_ = offered;
        free_ = static_cast<uint8_t>(slot_count - current_ - offered);
    }
    /// Background: take back what the tick has not taken.
    void withdraw() {
        settle(mailbox_.exchange(none, std::memory_order_acq_rel));
        published_ = none;
        free_ = static_cast<uint8_t>(current_ == 0 ? 1 : 0);
    }
    /// Tick: the new value, or nullptr. It stays valid until the next one is taken.
    const T *take() {
        const uint8_t slot = mailbox_.exchange(none, std::memory_order_acq_rel);
        return slot == none ? nullptr : &slots_[slot];
    }

private:
    static constexpr uint8_t slot_count = 3;
    static constexpr uint8_t none = 0xFF;

    /// Learn from what was in the mailbox whether the tick uses what was published last.
    void settle(uint8_t left) {
        if (left == none && published_ != none) {
            current_ = published_;
        }
    }

    T slots_[slot_count] = {};
    uint8_t current_ = 0; ///< slot that the tick may be using
    uint8_t published_ = none;
    uint8_t free_ = 1;
    std::atomic<uint8_t> mailbox_{none};
};

/// Queue with one producer (background) and one consumer (tick).
template <class T, size_t Capacity>
class Queue {
    static_assert((Capacity & (Capacity - 1)) == 0, "capacity must be a power of two");

public:
    /// @return false if it is full; nothing is queued then.
    bool push(const T &item) {
        const uint32_t head = head_.load(std::memory_order_relaxed);
        if (head - tail_.load(std::memory_order_acquire) == Capacity) {
            return false;
        }
        items_[head & (Capacity - 1)] = item;
        head_.store(head + 1, std::memory_order_release);
        return true;
    }
    /// The oldest item, or nullptr. Valid until drop().
    const T *front() const {
        const uint32_t tail = tail_.load(std::memory_order_relaxed);
        return tail == head_.load(std::memory_order_acquire) ? nullptr : &items_[tail & (Capacity - 1)];
    }
    void drop() { tail_.store(tail_.load(std::memory_order_relaxed) + 1, std::memory_order_release); }

private:
    T items_[Capacity] = {};
    std::atomic<uint32_t> head_{0};
    std::atomic<uint32_t> tail_{0};
};

} // namespace omni
