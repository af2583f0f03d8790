// SPDX-License-Identifier: MIT
#include "app/tick/i2c_scan.h"

#include <algorithm>

namespace omni {
namespace {

/// Ticks after which a busy bus counts as stuck.
constexpr uint8_t busy_limit = 10;

} // namespace

void I2cScan::start() {
    running_ = true;
    in_flight_ = true; // the motor driver's last batch, if there is one
    address_ = 0;
    busy_ticks_ = 0;
    std::fill(answered_, answered_ + sizeof answered_, uint8_t{0});
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

void I2cScan::step(I2cBus &bus) {
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
    I2cTransaction probe;
    probe.address = address_;
    in_flight_ = bus.submit(&probe, 1);
    if (!in_flight_ && ++busy_ticks_ >= busy_limit) {
        bus.recover();
        finish(true);
    }
}

} // namespace omni
