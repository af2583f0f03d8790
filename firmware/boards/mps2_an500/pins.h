// SPDX-License-Identifier: MIT
/// @file pins.h  The world at the board's pins: encoders, I2C, supply, stop button and one serial line, simulated by
/// the host.
///
/// Each tick sends the pin outputs and receives the pin inputs while the emulated time stands still. So the firmware
/// runs on the emulated processor's timing, and the world in lockstep with it.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"
#include "app/services/hil.h"
#include "boards/mps2_an500/uart_port.h"

namespace omni {

/// The serial line: so many bytes per tick and direction as 115200 baud carry.
class WirePort final : public SerialPort {
public:
    static constexpr size_t bytes_per_tick = 12;

    size_t read(uint8_t *data, size_t capacity) override;
    size_t write_space() override { return out_.free(); }
    bool write(const uint8_t *data, size_t length) override;
    uint32_t session() override { return 1; }

    bool waiting() const { return in_.used() > 0; }
    /// @return bytes put into `data`, bytes_per_tick at most.
    size_t take_sent(uint8_t *data);
    /// Overflow is lost, as on a line without flow control.
    void put_received(const uint8_t *data, size_t length);

private:
    Ring<4096> in_;
    Ring<8192> out_;
};

class Pins final : public Encoders, public OutputEnable, public StopButton {
public:
    HilBus bus;
    WirePort wire;

    /// @return false if the emulator has no standard input and output.
    bool connect();
    /// Exchanges; called once per tick.
    uint8_t read(int32_t *counts) override;
    void errors(uint32_t *errors) override;
    bool wired() override { return true; }
    void set(bool on) override { enabled_ = on ? 1 : 0; }
    void release() override { enabled_ = 2; }
    bool open() override { return button_open_; }
    float battery_V() const { return battery_V_; }
    void start(Clock &clock) { clock_ = &clock; }

private:
    Clock *clock_ = nullptr;
    int in_ = -1;
    int out_ = -1;
    uint8_t enabled_ = 0; ///< 2: high impedance
    float battery_V_ = 0.0f;
    bool button_open_ = false; ///< as the world showed it in the latest tick
};

} // namespace omni
