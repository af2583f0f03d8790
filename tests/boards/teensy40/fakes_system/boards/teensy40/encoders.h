// SPDX-License-Identifier: MIT
// Takes the place of the board's header of the same name.
#pragma once

#include "app/base/board.h"

namespace omni {

class Teensy40Encoders final : public Encoders {
public:
    void begin();
    uint8_t read(int32_t *) override { return 0; }
    void errors(uint32_t *) override {}
};

} // namespace omni
