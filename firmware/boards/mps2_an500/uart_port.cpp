// SPDX-License-Identifier: MIT
#include "boards/mps2_an500/uart_port.h"

#include <initializer_list>

namespace omni {
namespace {

constexpr uint8_t priority = 0x40;
/// 115200 baud; the emulator sends as fast as the other end takes it.
constexpr uint32_t divider = an500::clock_Hz / 115200;

} // namespace

void UartPort::open(size_t number) {
    uart_ = &an500::uart(number);
    is_radio_ = number == 1;
    receive_interrupt_ = an500::uart_interrupt[number];
    uart_->divider = divider;
    uart_->control = an500::uart_tx_enable | an500::uart_rx_enable | an500::uart_rx_interrupt;
    for (const uint32_t interrupt : {receive_interrupt_, receive_interrupt_ + 1}) {
        an500::set_priority(interrupt, priority);
        an500::enable_interrupt(interrupt);
    }
}

void UartPort::on_receive() {
    while (in_.free() > 0 && (uart_->state & an500::uart_rx_full) != 0) {
        uart_->interrupt = an500::uart_rx_pending;
        in_.put(static_cast<uint8_t>(uart_->data));
    }
    if (in_.free() == 0) {
        an500::disable_interrupt(receive_interrupt_);
        held_ = true;
    }
}

size_t UartPort::read(uint8_t *data, size_t capacity) {
    size_t count = 0;
    while (count < capacity && in_.used() > 0) {
        data[count++] = in_.take();
    }
    if (held_ && in_.free() > 0) {
        held_ = false;
        an500::enable_interrupt(receive_interrupt_);
    }
    return count;
}

void UartPort::on_transmit() {
    uart_->interrupt = an500::uart_tx_pending;
    while (out_.used() > 0 && (uart_->state & an500::uart_tx_full) == 0) {
        uart_->data = out_.take();
    }
    if (out_.used() == 0) {
        uart_->control = uart_->control & ~an500::uart_tx_interrupt;
        sent_by_interrupt_ = false;
    }
}

/// As long as the transmitter takes bytes at once there is no need for its interrupt.
void UartPort::send_from_background() {
    while (out_.used() > 0 && (uart_->state & an500::uart_tx_full) == 0) {
        uart_->data = out_.take();
    }
    if (out_.used() == 0) {
        return;
    }
    const an500::InterruptLock lock;
    sent_by_interrupt_ = true;
    uart_->control = uart_->control | an500::uart_tx_interrupt;
    // It may have become empty before its interrupt was on.
    if ((uart_->state & an500::uart_tx_full) == 0) {
        uart_->data = out_.take();
    }
}

bool UartPort::write(const uint8_t *data, size_t length) {
    if (length > out_.free()) {
        return false;
    }
    for (size_t i = 0; i < length; ++i) {
        out_.put(data[i]);
    }
    if (!sent_by_interrupt_) {
        send_from_background();
    }
    return true;
}

} // namespace omni
