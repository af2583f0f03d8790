// SPDX-License-Identifier: MIT
/// @file scan_service.h  MAV_CMD_OMNI_I2C_SCAN: who answers on the bus. Answered at once, and with OMNI_I2C_SCAN when
/// it is over.
#pragma once

#include "app/services/hil_switch.h"
#include "app/services/robot_state.h"

namespace omni {

class ScanService {
public:
    ScanService(Links &links, Texts &texts, const RobotClock &clock, RobotState &robot, ControlLoop &control,
                const HilSwitch &hil)
        : links_(links), texts_(texts), clock_(clock), robot_(robot), control_(control), hil_(hil) {}

    /// @return MAV_RESULT. Refused while armed.
    uint8_t start(const Sender &sender);
    /// Asked for, and its result not sent yet.
    bool running() const { return running_; }
    /// Send the result of a scan that has come to its end.
    void serve();
    /// The control loop begins anew, on another bus: whoever waits for a scan is told that no result comes.
    void restart();

private:
    Links &links_;
    Texts &texts_;
    const RobotClock &clock_;
    RobotState &robot_;
    ControlLoop &control_;
    const HilSwitch &hil_;
    Sender sender_;
    uint32_t scans_before_ = 0;
    bool running_ = false;
};

} // namespace omni
