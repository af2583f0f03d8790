// SPDX-License-Identifier: MIT
/// @file no_hardware.h  Stand-ins for the hardware that a computer without a robot does not have.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/board.h"

namespace omni {

/// Encoders of wheels at rest.
class NoEncoders final : public Encoders {
public:
    uint8_t read(int32_t *counts) override;
    void errors(uint32_t *errors) override;
};

/// No pin, no motors.
class NoOutputEnable final : public OutputEnable {
public:
    bool wired() override { return false; }
    void set(bool) override {}
};

/// A PWM chip alone on its bus: stores its registers, without motors.
class NoMotorsBus final : public I2cBus {
public:
    bool submit(const I2cTransaction *batch, size_t count) override;
    I2cStatus poll(uint8_t *read) override;
    void recover() override {}

private:
    uint8_t registers_[256] = {};
    uint8_t read_ = 0;
    bool submitted_ = false;
    bool acknowledged_ = true;
};

} // namespace omni
