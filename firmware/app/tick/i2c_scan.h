// SPDX-License-Identifier: MIT
/// @file i2c_scan.h  Scans the I2C bus for devices, one address per tick, with exclusive use of the bus.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"

namespace omni {

/// Result of a scan.
struct I2cFound {
    uint32_t scans = 0;      ///< complete scans since boot
    uint8_t addresses[16]{}; ///< bit a % 8 of byte a / 8
    bool stuck = false;      ///< aborted: a line is held low
};

class I2cScan {
public:
    static constexpr uint8_t first_address = 0x08; ///< addresses below and above are reserved
    static constexpr uint8_t last_address = 0x77;

    void start();
    /// Abort; found() keeps the last complete scan. Only while no tick can run.
    void restart() { running_ = false; }
    bool running() const { return running_; }
    /// Once per tick in place of the motor driver.
    void step(I2cBus &bus);
    const I2cFound &found() const { return found_; }

private:
    void take(I2cStatus status);
    void finish(bool stuck);

    bool running_ = false;
    bool in_flight_ = false;
    uint8_t address_ = 0; ///< 0: still the motor driver's batch
    uint8_t busy_ticks_ = 0;
    uint8_t answered_[16] = {};
    I2cFound found_;
};

} // namespace omni
