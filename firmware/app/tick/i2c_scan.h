// SPDX-License-Identifier: MIT
/// @file i2c_scan.h  Scans the I2C bus for devices, one address per tick, with exclusive use of the bus.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/drivers/motor_driver.h"

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

    /// Start, if none is running. @return true if so: the motor driver initialises its hardware again afterwards.
    bool start();
    /// Abort; found() keeps the last complete scan. Only while no tick can run.
    void restart() { running_ = false; }
    bool running() const { return running_; }
    /// Once per tick in place of the motor driver, with its bus.
    void step(MotorDriver &driver, MotorWires &wires);
    const I2cFound &found() const { return found_; }

private:
    void probe(I2cBus &bus);
    void take(I2cStatus status);
    void finish(bool stuck);

    static constexpr uint8_t all_off_attempts = 10;
    bool running_ = false;
    uint8_t all_off_ticks_left_ = 0; ///< remaining ticks in which it waits for "all off" to be sent
    bool in_flight_ = false;
    uint8_t address_ = 0; ///< 0: still the motor driver's batch
    uint8_t busy_ticks_ = 0;
    uint8_t answered_[16] = {};
    I2cFound found_;
};

} // namespace omni
