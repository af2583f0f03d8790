// SPDX-License-Identifier: MIT
// Takes the place of the application: main.cpp's own work can then be watched.
#pragma once

#include "app/base/board.h"

namespace omni {

class App {
public:
    App(const Board &board, bool lockstep);
    void tick();
    void background();
    bool reboot_wanted() const;
};

} // namespace omni
