// SPDX-License-Identifier: MIT
/// @file storage.h  The flash sectors that Teensyduino keeps for its EEPROM emulation, which an upload leaves alone.
#pragma once

#include <cstddef>
#include <cstdint>

#include "boards/teensy40/flash_log.h"
#include "boards/teensy40/watchdog.h"

namespace omni {

/// Interrupts are off while the chip works: up to 0.4 ms for each 32 bytes that are programmed (the tick starts late), 45 to
/// 400 ms for an erase (ticks are lost, and the edges of encoders that interrupts count).
class Teensy40Flash final : public Flash {
public:
    explicit Teensy40Flash(Teensy40Watchdog &watchdog) : watchdog_(watchdog) {}
    /// From now on erasing must not look like a hang.
    void watched() { watched_ = true; }

    size_t sectors() override { return 15; }
    void read(size_t sector, size_t offset, uint8_t *data, size_t length) override;
    void program(size_t sector, size_t offset, const uint8_t *data, size_t length) override;
    void erase(size_t sector) override;

private:
    Teensy40Watchdog &watchdog_;
    bool watched_ = false;
};

} // namespace omni
