// SPDX-License-Identifier: MIT
/// @file snapshot.h  Lock-free, wait-free exchange between the tick (an interrupt) and the background.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace omni {

/// Latest value from one writer to one reader: triple buffer. Each side owns one slot and exchanges the third.
template <class T>
class Snapshot {
public:
    /// Writer: slot to fill before publish().
    T &writing() { return slots_[write_]; }
    void publish() { write_ = middle_.exchange(write_ | fresh, std::memory_order_acq_rel) & index_mask; }
    /// Reader: switch to the latest value. @return false if nothing was published since; reading() is then unchanged.
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

/// Large value from the background to the tick, used in place (triple buffer). A published value that the tick has not
/// taken may be replaced or withdrawn.
template <class T>
class Mailbox {
public:
    /// Background: slot to fill before publish().
    T &scratch() { return slots_[free_]; }
    /// Background: publish the scratch slot; the tick takes it at its next run.
    void publish() {
        const uint8_t offered = free_;
        update_current(mailbox_.exchange(offered, std::memory_order_acq_rel));
        published_ = offered;
        free_ = static_cast<uint8_t>(slot_count - current_ - offered);
    }
    /// Background: withdraw a value that the tick has not taken.
    void withdraw() {
        update_current(mailbox_.exchange(none, std::memory_order_acq_rel));
        published_ = none;
        free_ = static_cast<uint8_t>(current_ == 0 ? 1 : 0);
    }
    /// Tick: take a new value, or nullptr. It is valid until the next one is taken.
    const T *take() {
        if (mailbox_.load(std::memory_order_relaxed) == none) {
            return nullptr; // in most ticks: saves the exchange
        }
        const uint8_t slot = mailbox_.exchange(none, std::memory_order_acq_rel);
        return slot == none ? nullptr : &slots_[slot];
    }

private:
    static constexpr uint8_t slot_count = 3;
    static constexpr uint8_t none = 0xFF;

    /// Update `current_`: an empty mailbox means that the tick has taken the published slot.
    void update_current(uint8_t left) {
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
    /// Append an item. @return false if the queue is full.
    bool push(const T &item) {
        const uint32_t head = head_.load(std::memory_order_relaxed);
        if (head - tail_.load(std::memory_order_acquire) == Capacity) {
            return false;
        }
        items_[head & (Capacity - 1)] = item;
        head_.store(head + 1, std::memory_order_release);
        return true;
    }
    /// Oldest item, or nullptr. Valid until drop().
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
