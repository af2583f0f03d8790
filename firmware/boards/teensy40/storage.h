// SPDX-License-Identifier: MIT
/// @file storage.h  The flash sectors that Teensyduino keeps for its EEPROM emulation, which an upload leaves alone.
#pragma once

#include <cstddef>
#include <cstdint>

#include "boards/teensy40/flash_log.h"
#include "boards/teensy40/i2c.h"
#include "boards/teensy40/watchdog.h"

namespace omni {

/// Any length may be programmed anywhere. The driver pads to the units that the core's copy routine is safe with, with
/// ones, which leave NOR flash as it is.
///
/// Interrupts are off while the chip works. That is up to 0.4 ms for each 32 bytes that are programmed; the tick starts
/// late. It is 45 to 400 ms for an erase; ticks are lost, and the edges of encoders that interrupts count.
class Teensy40Flash final : public Flash {
public:
    /// @param bus whose update is let end first: it may be the one that stops the motors, and needs interrupts.
    /// nullptr: none.
    explicit Teensy40Flash(Teensy40Watchdog &watchdog, const Teensy40I2c *bus = nullptr)
        : watchdog_(watchdog), bus_(bus) {}
    /// The watchdog runs from now on: extend its timeout while erasing.
    void watched() { watched_ = true; }

    size_t sectors() override { return 15; }
    void read(size_t sector, size_t offset, uint8_t *data, size_t length) override;
    void program(size_t sector, size_t offset, const uint8_t *data, size_t length) override;
    void erase(size_t sector) override;

private:
    void wait_for_bus(uint32_t patience_ms);

    Teensy40Watchdog &watchdog_;
    const Teensy40I2c *bus_;
    bool watched_ = false;
};

} // namespace omni
