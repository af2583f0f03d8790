// SPDX-License-Identifier: MIT
#include "app/tick/i2c_scan.h"

#include <algorithm>

namespace omni {
namespace {

/// Ticks after which a busy bus counts as stuck.
constexpr uint8_t busy_limit = 10;

} // namespace

bool I2cScan::start() {
    if (running_) {
        return false;
    }
    running_ = true;
    all_off_ticks_left_ = all_off_attempts;
    in_flight_ = true; // the motor driver's last batch, if there is one
    address_ = 0;
    busy_ticks_ = 0;
    std::fill(answered_, answered_ + sizeof answered_, uint8_t{0});
    return true;
}

void I2cScan::finish(bool stuck) {
    running_ = false;
    ++found_.scans;
    std::copy(answered_, answered_ + sizeof answered_, found_.addresses);
    found_.stuck = stuck;
}

void I2cScan::take(I2cStatus status) {
    in_flight_ = false;
    busy_ticks_ = 0;
    if (address_ != 0 && status == I2cStatus::done) {
        answered_[address_ / 8] = static_cast<uint8_t>(answered_[address_ / 8] | 1u << address_ % 8);
    }
    address_ = address_ == 0 ? first_address : static_cast<uint8_t>(address_ + 1);
}

void I2cScan::step(MotorDriver &driver, MotorWires &wires) {
    wires.enable.set(false);
    if (all_off_ticks_left_ > 0) {
        // The update that stopped the motors may have failed or be pending, and there is none while the scan has the
        // bus.
        all_off_ticks_left_ = driver.all_off(wires) ? 0 : static_cast<uint8_t>(all_off_ticks_left_ - 1);
        return;
    }
    probe(wires.bus);
    if (!running_) {
        driver.restart();
    }
}

void I2cScan::probe(I2cBus &bus) {
    uint8_t read[I2cTransaction::max_read] = {};
    const I2cStatus status = in_flight_ ? bus.poll(read) : I2cStatus::idle;
    const bool busy = status == I2cStatus::busy;
    if (busy && ++busy_ticks_ < busy_limit) {
        return;
    }
    if (busy || (status == I2cStatus::stuck && address_ != 0)) {
        bus.recover();
        finish(true);
        return;
    }
    if (in_flight_) {
        take(status);
    }
    if (address_ > last_address) {
        finish(false);
        return;
    }
    I2cTransaction transaction;
    transaction.address = address_;
    in_flight_ = bus.submit(&transaction, 1);
    if (!in_flight_ && ++busy_ticks_ >= busy_limit) {
        bus.recover();
        finish(true);
    }
}

} // namespace omni
