// SPDX-License-Identifier: MIT
/// @file arming.h  Commands to arm, disarm, e-stop and release the e-stop.
///
/// Stops are always executed immediately. Arming is refused, with a reason, if a motor could move unexpectedly.
#pragma once

#include "app/link/signing.h"
#include "app/services/button_watch.h"
#include "app/services/heartbeats.h"
#include "app/services/hil_switch.h"
#include "app/services/scan_service.h"
#include "app/services/trajectories.h"

namespace omni {

class Arming {
public:
    /// Other conditions for arming.
    struct Conditions {
        OutputEnable &output_enable;
        const ScanService &scan;
        const HilSwitch &hil;
    };

    Arming(const Conditions &conditions, Texts &texts, RobotState &robot, ControlLoop &control, Heartbeats &heartbeats,
           ButtonWatch &button, Signing &signing, Trajectories &trajectories)
        : conditions_(conditions), texts_(texts), robot_(robot), control_(control), heartbeats_(heartbeats),
          button_(button), signing_(signing), trajectories_(trajectories) {}

    /// MAV_CMD_COMPONENT_ARM_DISARM. @param wanted 1: arm, 0: disarm. @return MAV_RESULT
    uint8_t command(float wanted, const Sender &sender);
    uint8_t estop(const Sender &sender);
    /// MAV_CMD_OMNI_ESTOP. Only the exact value for a release releases; any other value stops (fail-safe).
    uint8_t estop_or_release(float stop, const Sender &sender);

private:
    uint8_t arm(const Sender &sender);
    void warn_missing_output_enable();
    uint8_t stop(uint32_t event, const Sender &sender);
    uint8_t release();

    const Conditions conditions_;
    Texts &texts_;
    RobotState &robot_;
    ControlLoop &control_;
    Heartbeats &heartbeats_;
    ButtonWatch &button_;
    Signing &signing_;
    Trajectories &trajectories_;
    bool pin_said_ = false;
};

} // namespace omni
