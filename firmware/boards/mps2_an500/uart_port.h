// SPDX-License-Identifier: MIT
/// @file uart_port.h  A MAVLink link over a serial port: both directions by interrupt, through rings, never waiting.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "app/base/board.h"
#include "boards/mps2_an500/base/machine.h"

namespace omni {

/// Bytes from one context to another: one side puts, the other takes.
template <size_t size>
class Ring {
    static_assert((size & (size - 1)) == 0, "a power of two");

public:
    size_t used() const { return put_.load(std::memory_order_acquire) - taken_.load(std::memory_order_acquire); }
    size_t free() const { return size - used(); }
    /// Only while free() > 0.
    void put(uint8_t byte) {
        const size_t at = put_.load(std::memory_order_relaxed);
        bytes_[at % size] = byte;
        put_.store(at + 1, std::memory_order_release);
    }
    /// Only while used() > 0.
    uint8_t take() {
        const size_t at = taken_.load(std::memory_order_relaxed);
        const uint8_t byte = bytes_[at % size];
        taken_.store(at + 1, std::memory_order_release);
        return byte;
    }

private:
    std::atomic<size_t> put_{0};
    std::atomic<size_t> taken_{0};
    uint8_t bytes_[size] = {};
};

class UartPort final : public SerialPort {
public:
    /// @param number of the serial port. A radio is on the second one.
    void open(size_t number);
    size_t read(uint8_t *data, size_t capacity) override;
    size_t write_space() override { return out_.free(); }
    bool write(const uint8_t *data, size_t length) override;
    /// A serial port does not detect connections.
    uint32_t session() override { return 1; }
    bool is_radio() override { return is_radio_; }

    /// Received bytes wait.
    bool waiting() const { return in_.used() > 0; }
    /// Everything has been sent.
    bool drained() const { return out_.used() == 0; }

    void on_receive();
    void on_transmit();

private:
    void send_from_background();

    an500::Uart *uart_ = nullptr;
    bool is_radio_ = false;
    uint32_t receive_interrupt_ = 0;
    Ring<4096> in_;
    Ring<8192> out_;
    std::atomic<bool> held_{false}; ///< the interrupt has stopped receiving until there is room
    std::atomic<bool> sent_by_interrupt_{false};
};

} // namespace omni
