// SPDX-License-Identifier: MIT
// Takes the place of the board's header of the same name.
#pragma once

#include "app/board.h"

namespace omni {

class Teensy40I2c final : public I2cBus {
public:
    void begin();
    bool submit(const I2cTransaction *batch, size_t count) override;
    I2cStatus poll(uint8_t *) override;
    void recover() override;
    bool on_wire() const;
};

} // namespace omni
