// SPDX-License-Identifier: MIT
/// @file console_port.h  A MAVLink link over the emulator's standard input and output: whole blocks at a time, for
/// lockstep.
///
/// An emulated serial port costs the emulator's main loop a round per byte; this link, one call per direction.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"

namespace omni {

class ConsolePort final : public SerialPort {
public:
    /// @param radio it stands for a radio. @return false if the emulator has no console.
    bool open(bool radio);
    /// Wait for bytes; the whole machine stands still. Ends the emulator when the other end has closed.
    void wait();
    bool waiting() const { return taken_ < filled_; }
    /// True once after a transmission: more may be queued.
    bool has_sent();
    size_t read(uint8_t *data, size_t capacity) override;
    size_t write_space() override { return most_; }
    bool write(const uint8_t *data, size_t length) override;
    /// It does not detect connections.
    uint32_t session() override { return 1; }
    bool is_radio() override { return is_radio_; }

private:
    static constexpr size_t most_ = 8192;
    int in_ = -1;
    int out_ = -1;
    size_t filled_ = 0;
    size_t taken_ = 0;
    bool sent_ = false;
    bool is_radio_ = false;
    uint8_t bytes_[1024] = {};
};

} // namespace omni
