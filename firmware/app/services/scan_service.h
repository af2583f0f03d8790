// SPDX-License-Identifier: MIT
/// @file scan_service.h  MAV_CMD_OMNI_I2C_SCAN: lists the devices on the bus. Acknowledged at once; OMNI_I2C_SCAN
/// follows at the end.
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
    /// A scan is running, or its result has not been sent.
    bool running() const { return running_; }
    /// Send the result of a completed scan.
    void serve();
    /// Abort the scan because the control loop restarts on another bus; the requester gets a text.
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
