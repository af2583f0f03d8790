// SPDX-License-Identifier: MIT
/// @file ports.h  The two links: USB, and the radio on Serial1. Neither ever waits.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"

namespace omni {

/// USB serial port. A connection lasts as long as a program on the other side holds the port open (DTR) and the bus is
/// awake. Teensyduino does not notice a pulled cable. But the bus falls silent and the port takes that for suspend.
class UsbPort final : public SerialPort {
public:
    /// Discards input without a connection, so that the next peer's session does not begin with stale commands. Flushes
    /// earlier output.
    size_t read(uint8_t *data, size_t capacity) override;
    /// Whole free buffers only: Teensyduino's write would wait up to 120 ms for more. 0 without a connection.
    size_t write_space() override;
    bool write(const uint8_t *data, size_t length) override;
    uint32_t session() override;
    /// The uploader's baud rate: Teensyduino jumps to the bootloader 10 ms (at 12 Mbit/s 80 ms) later, whatever the
    /// motors do. From any context.
    bool upload_asked() const;

private:
    void send_rest();

    bool open_ = false;
    bool written_ = false; ///< since the last read()
    uint32_t sessions_ = 0;
};

/// Radio modem on Serial1: pins 0 (RX) and 1 (TX).
class RadioPort final : public SerialPort {
public:
    void begin(uint32_t baud);
    size_t read(uint8_t *data, size_t capacity) override;
    size_t write_space() override;
    bool write(const uint8_t *data, size_t length) override;
    uint32_t session() override { return 1; }
    /// Done in a later read(), when what was written before has left; until then nothing new is taken.
    void set_baud(uint32_t baud) override { wanted_baud_ = baud; }
    bool has_baud() override { return true; }
    bool is_radio() override { return true; }

private:
    void follow_baud();
    bool line_idle();
    static size_t free_space();
    /// Twice the longest MAVLink frame: more would only delay telemetry.
    static constexpr size_t more_for_writing = 560;
    /// 0.35 s at 115200 baud: as long as a flash erase may hold up the background.
    static constexpr size_t more_for_reading = 4096;

    uint32_t baud_ = 0;
    uint32_t wanted_baud_ = 0;
    size_t capacity_ = 0;
    uint8_t write_memory_[more_for_writing];
    uint8_t read_memory_[more_for_reading];
};

} // namespace omni
