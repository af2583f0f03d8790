// SPDX-License-Identifier: MIT
// An I2C bus with the model of a gyro's chip on it. A batch is done by the next tick, unless a line is held low.
#pragma once

#include <algorithm>

#include "app/base/board.h"

extern "C" {
#include "hil_sim/gyro_chip.h"
}

namespace omni {

class GyroBus final : public I2cBus {
public:
    explicit GyroBus(uint8_t kind = HIL_GYRO_ICM42688) { hil_gyro_chip_reset(&chip, kind, address_of(kind)); }

    static uint8_t address_of(uint8_t kind) {
        return kind == HIL_GYRO_LSM6DSO || kind == HIL_GYRO_ISM330DHCX ? 0x6A : 0x68;
    }

    bool submit(const I2cTransaction *batch, size_t count) override {
        ++batches;
        if (busy_) {
            return false;
        }
        std::fill(read_, read_ + sizeof read_, uint8_t{0});
        busy_ = true;
        acknowledged_ = !held;
        uint32_t bytes = 0;
        for (size_t i = 0; i < count && acknowledged_; ++i) {
            acknowledged_ = carry(batch[i]);
            bytes += 1u + batch[i].write_length + (batch[i].read_length > 0 ? 1u + batch[i].read_length : 0u);
        }
        longest_bytes = std::max(longest_bytes, bytes);
        hil_gyro_chip_stop(&chip);
        return true;
    }
    I2cStatus poll(uint8_t *read) override {
        if (!busy_) {
            return I2cStatus::idle;
        }
        if (held) {
            return I2cStatus::busy;
        }
        busy_ = false;
        std::copy(read_, read_ + sizeof read_, read);
        return acknowledged_ ? I2cStatus::done : I2cStatus::nack;
    }
    void recover() override {
        ++recoveries;
        busy_ = false;
    }

    hil_gyro_chip_t chip{};
    bool held = false;
    uint32_t batches = 0;
    uint32_t longest_bytes = 0; ///< of a batch, addresses included
    uint32_t recoveries = 0;

private:
    bool carry(const I2cTransaction &transaction) {
        bool good = true;
        if (transaction.write_length > 0) {
            good = hil_gyro_chip_start(&chip, transaction.address, false);
            for (size_t i = 0; i < transaction.write_length && good; ++i) {
                good = hil_gyro_chip_put(&chip, transaction.write[i]);
            }
        }
        if (transaction.read_length > 0 && good) {
            good = hil_gyro_chip_start(&chip, transaction.address, true);
            for (size_t i = 0; i < transaction.read_length && good; ++i) {
                read_[i] = hil_gyro_chip_get(&chip);
            }
        }
        return good;
    }

    bool busy_ = false;
    bool acknowledged_ = true;
    uint8_t read_[I2cTransaction::max_read] = {};
};

} // namespace omni
