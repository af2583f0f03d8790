// SPDX-License-Identifier: MIT
#include "boards/teensy40/ports.h"

#include <Arduino.h>

#include <algorithm>

namespace omni {
namespace {

constexpr uint32_t uploader_baud = 134;

bool usb_awake() {
    return usb_configuration != 0 && (USB1_PORTSC1 & USB_PORTSC1_SUSP) == 0;
}

} // namespace

bool UsbPort::upload_asked() const {
    return Serial.baud() == uploader_baud;
}

uint32_t UsbPort::session() {
    const bool open = usb_awake() && Serial.dtr() != 0;
    if (open && !open_) {
        ++sessions_;
    }
    open_ = open;
    return open ? sessions_ : 0;
}

/// Teensyduino sends a part-filled buffer 75 us after the last write, by a timer. If that comes while write_space() or
/// write() runs it does nothing and is not started again. The bytes would wait for the next write, and a host in the
/// loop that waits for them for ever. Not while its interrupt could send the same buffer.
void UsbPort::send_rest() {
    if (written_) {
        written_ = false;
        NVIC_DISABLE_IRQ(IRQ_USB1);
        usb_serial_flush_output();
        NVIC_ENABLE_IRQ(IRQ_USB1);
    }
}

size_t UsbPort::read(uint8_t *data, size_t capacity) {
    if (session() == 0) {
        written_ = false;
        if (usb_configuration != 0) {
            usb_serial_flush_input();
        }
        return 0;
    }
    send_rest();
    const int count = usb_serial_read(data, static_cast<uint32_t>(capacity));
    return count > 0 ? static_cast<size_t>(count) : 0;
}

size_t UsbPort::write_space() {
    return session() != 0 ? static_cast<size_t>(std::max(usb_serial_write_buffer_free(), 0)) : 0;
}

bool UsbPort::write(const uint8_t *data, size_t length) {
    if (length > write_space()) {
        return false;
    }
    written_ = true;
    return usb_serial_write(data, static_cast<uint32_t>(length)) == static_cast<int>(length);
}

void RadioPort::begin(uint32_t baud) {
    Serial1.addMemoryForWrite(write_memory_, sizeof write_memory_);
    Serial1.addMemoryForRead(read_memory_, sizeof read_memory_);
    baud_ = wanted_baud_ = baud;
    Serial1.begin(baud);
    capacity_ = free_space();
}

size_t RadioPort::free_space() {
    return static_cast<size_t>(std::max(Serial1.availableForWrite(), 0));
}

/// Buffer, FIFO and shift register are empty.
bool RadioPort::line_idle() {
    return free_space() >= capacity_ && (LPUART6_STAT & LPUART_STAT_TC) != 0;
}

void RadioPort::follow_baud() {
    if (wanted_baud_ != baud_ && line_idle()) {
        baud_ = wanted_baud_;
        Serial1.begin(baud_);
    }
}

size_t RadioPort::read(uint8_t *data, size_t capacity) {
    follow_baud();
    const size_t count = std::min(capacity, static_cast<size_t>(std::max(Serial1.available(), 0)));
    for (size_t i = 0; i < count; ++i) {
        data[i] = static_cast<uint8_t>(Serial1.read());
    }
    return count;
}

size_t RadioPort::write_space() {
    return wanted_baud_ == baud_ ? free_space() : 0;
}

bool RadioPort::write(const uint8_t *data, size_t length) {
    return length <= write_space() && Serial1.write(data, length) == length;
}

} // namespace omni
