// SPDX-License-Identifier: MIT
#include "boards/common/no_hardware.h"

#include <algorithm>

#include "app/drivers/pca9685.h"

namespace omni {

uint8_t NoEncoders::read(int32_t *counts) {
    std::fill(counts, counts + OMNI_MAX_WHEELS, 0);
    return (1u << OMNI_MAX_WHEELS) - 1;
}

void NoEncoders::errors(uint32_t *errors) {
    std::fill(errors, errors + OMNI_MAX_WHEELS, 0u);
}

bool NoMotorsBus::submit(const I2cTransaction *batch, size_t count) {
    for (size_t i = 0; i < count; ++i) {
        const I2cTransaction &transaction = batch[i];
        acknowledged_ = transaction.address == Pca9685::address;
        if (!acknowledged_) {
            break;
        }
        if (transaction.write_length == 0) {
            continue;
        }
        uint8_t pointer = transaction.write[0];
        for (size_t at = 1; at < transaction.write_length; ++at) {
            registers_[pointer++] = transaction.write[at];
        }
        read_ = registers_[pointer];
    }
    submitted_ = true;
    return true;
}

I2cStatus NoMotorsBus::poll(uint8_t *read) {
    read[0] = read_;
    const bool done = submitted_;
    submitted_ = false;
    const I2cStatus outcome = acknowledged_ ? I2cStatus::done : I2cStatus::nack;
    return done ? outcome : I2cStatus::idle;
}

} // namespace omni
