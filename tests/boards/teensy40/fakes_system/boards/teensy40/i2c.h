// SPDX-License-Identifier: MIT
// Takes the place of the board's header of the same name.
#pragma once

#include "app/base/board.h"

namespace omni {

class Teensy40I2c final : public I2cBus {
public:
    void begin();
    bool submit(const I2cTransaction *batch, size_t count) override;
    I2cStatus poll(uint8_t *) override;
    void recover() override;
    bool on_wire() const;
};

/// No robot here has one of these sensors.
class Teensy40GyroI2c final : public I2cBus {
public:
    explicit Teensy40GyroI2c(uint32_t) {}
    void begin() {}
    bool submit(const I2cTransaction *, size_t) override { return false; }
    I2cStatus poll(uint8_t *) override { return I2cStatus::idle; }
    void recover() override {}
};

using Teensy40FlowI2c = Teensy40GyroI2c;

} // namespace omni
