// SPDX-License-Identifier: MIT
// USB port and Serial1 of the model behind fakes_system/Arduino.h.
#include <Arduino.h>
#include <cstring>

volatile uint8_t usb_configuration;
volatile uint32_t USB1_PORTSC1, LPUART6_STAT;
FakeUsbSerial Serial;
FakeHardwareSerial Serial1;

void fake_ports_reset(); // fake_teensy.cpp calls it

namespace {

// ---- USB: a ring of transmit buffers, drained by the host in order
constexpr uint32_t tx_buffers = 4, tx_size = 2048, rx_size = 4096;
struct Usb {
    bool dtr;
    bool waited;
    uint32_t baud;
    bool interrupt_off, raced;
    uint32_t head, in_flight, room; ///< room left in the buffer at head; 0: none begun
    uint8_t out[1 << 16], in[rx_size];
    uint32_t out_count, in_count;
} usb;

struct Radio {
    size_t write_capacity, read_capacity;
    uint32_t baud, begins;
    bool waited;
    uint8_t out[1 << 16], in[8192];
    size_t out_count, queued, in_count;
} radio;

} // namespace

void fake_ports_reset() {
    usb = {};
    radio = {};
    radio.write_capacity = 64;
    radio.read_capacity = 64;
    usb_configuration = 0;
    USB1_PORTSC1 = 0;
    LPUART6_STAT = LPUART_STAT_TC;
}

// ---- USB
uint8_t FakeUsbSerial::dtr() {
    return usb.dtr ? 1 : 0;
}
uint32_t FakeUsbSerial::baud() {
    return usb.baud;
}
int usb_serial_write_buffer_free() {
    // Buffers in flight are the ones before head; the one at head does not count.
    const uint32_t others = tx_buffers - 1;
    return static_cast<int>((others - (usb.in_flight < others ? usb.in_flight : others)) * tx_size);
}
int usb_serial_write(const void *data, uint32_t size) {
    const auto *bytes = static_cast<const uint8_t *>(data);
    for (uint32_t i = 0; i < size; ++i) {
        if (usb.room == 0) {
            if (usb.in_flight == tx_buffers) {
                usb.waited = true; // up to 120 ms
                return static_cast<int>(i);
            }
            usb.room = tx_size;
        }
        usb.out[usb.out_count++] = bytes[i];
        if (--usb.room == 0) {
            ++usb.in_flight;
        }
    }
    return static_cast<int>(size);
}
int usb_serial_read(void *data, uint32_t size) {
    const uint32_t count = size < usb.in_count ? size : usb.in_count;
    std::memcpy(data, usb.in, count);
    usb.in_count -= count;
    std::memmove(usb.in, usb.in + count, usb.in_count);
    return static_cast<int>(count);
}
void usb_serial_flush_input() {
    usb.in_count = 0;
}
/// The interrupt sends the same buffer when the flush timer fires: in the middle of this, that would be 2048 bytes of
/// anything.
void usb_serial_flush_output() {
    usb.raced = usb.raced || !usb.interrupt_off;
    if (usb.room != 0 && usb.in_flight < tx_buffers) {
        usb.room = 0;
        ++usb.in_flight;
    }
}
void NVIC_DISABLE_IRQ(int number) {
    usb.interrupt_off = usb.interrupt_off || number == IRQ_USB1;
}
void NVIC_ENABLE_IRQ(int number) {
    usb.interrupt_off = usb.interrupt_off && number != IRQ_USB1;
}

// ---- Serial1
void FakeHardwareSerial::addMemoryForWrite(void *, size_t length) {
    radio.write_capacity = 64 + length;
}
void FakeHardwareSerial::addMemoryForRead(void *, size_t length) {
    radio.read_capacity = 64 + length;
}
void FakeHardwareSerial::begin(uint32_t baud) {
    radio.baud = baud;
    ++radio.begins;
    radio.queued = 0;
    radio.in_count = 0;
}
int FakeHardwareSerial::available() {
    return static_cast<int>(radio.in_count);
}
int FakeHardwareSerial::read() {
    if (radio.in_count == 0) {
        return -1;
    }
    const int first = radio.in[0];
    std::memmove(radio.in, radio.in + 1, --radio.in_count);
    return first;
}
int FakeHardwareSerial::availableForWrite() {
    return static_cast<int>(radio.write_capacity - 1 - radio.queued);
}
size_t FakeHardwareSerial::write(const uint8_t *data, size_t length) {
    for (size_t i = 0; i < length; ++i) {
        radio.waited = radio.waited || radio.queued + 1 >= radio.write_capacity;
        radio.out[radio.out_count++] = data[i];
        ++radio.queued;
    }
    return length;
}

extern "C" {

/// Teensyduino never takes the configuration back; a pulled cable looks like suspend.
void fake_usb_plug(bool plugged) {
    usb_configuration = plugged ? 1 : usb_configuration;
    USB1_PORTSC1 = plugged ? 0 : USB_PORTSC1_SUSP;
}
void fake_usb_baud(uint32_t baud) {
    usb.baud = baud;
}
void fake_usb_dtr(bool dtr) {
    usb.dtr = dtr;
}
void fake_usb_host_sends(const uint8_t *data, uint32_t length) {
    std::memcpy(usb.in + usb.in_count, data, length);
    usb.in_count += length;
}
/// The 75 us timer sends what was begun; the host reads `buffers` of what is under way.
void fake_usb_host_reads(uint32_t buffers) {
    if (usb.room != 0 && usb.in_flight < tx_buffers) {
        usb.room = 0;
        ++usb.in_flight;
    }
    usb.in_flight -= buffers < usb.in_flight ? buffers : usb.in_flight;
}
/// Buffers given to the controller, without the flush timer, which may miss its moment.
uint32_t fake_usb_under_way() {
    return usb.raced || usb.interrupt_off ? ~0u : usb.in_flight;
}
bool fake_usb_waited() {
    return usb.waited;
}
uint32_t fake_usb_sent(uint8_t *out) {
    std::memcpy(out, usb.out, usb.out_count);
    return usb.out_count;
}
void fake_radio_arrives(const uint8_t *data, size_t length) {
    for (size_t i = 0; i < length && radio.in_count + 1 < radio.read_capacity; ++i) {
        radio.in[radio.in_count++] = data[i];
    }
}
void fake_radio_sends(size_t bytes) {
    radio.queued -= bytes < radio.queued ? bytes : radio.queued;
}
size_t fake_radio_sent(uint8_t *out) {
    std::memcpy(out, radio.out, radio.out_count);
    return radio.out_count;
}
/// The last byte is still in the shift register, or gone.
void fake_radio_shifts(bool shifts) {
    LPUART6_STAT = shifts ? 0 : LPUART_STAT_TC;
}
uint32_t fake_radio_baud() {
    return radio.baud;
}
uint32_t fake_radio_begins() {
    return radio.begins;
}
bool fake_radio_waited() {
    return radio.waited;
}
}
