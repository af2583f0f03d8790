// SPDX-License-Identifier: MIT
/// @file commands.h  COMMAND_LONG, COMMAND_INT and SET_MODE. Every command is acknowledged; an unknown one as UNSUPPORTED.
///
/// Arm and disarm are the same command, and COMMAND_ACK says nothing of its parameters: a late one of "arm" looks like that of
/// "disarm". So whoever numbers his commands in param5, which none of them uses, gets a receipt in COMMAND_ACK.result_param2: the
/// CRC-32 of all seven parameters as they came. Without a number it is 0.
#pragma once

#include "app/parameters.h"
#include "app/shared.h"
#include "app/telemetry.h"
#include "app/trajectories.h"

namespace omni {

/// Enters and leaves host-in-the-loop; the application is one.
class HilSwitch {
public:
    /// @return MAV_RESULT
    virtual uint8_t switch_hil(bool enable, size_t link) = 0;
    /// Host-in-the-loop without a sensor message yet.
    virtual bool hil_silent() const = 0;

protected:
    ~HilSwitch() = default;
};

class Commands {
public:
    Commands(Shared &shared, Parameters &parameters, Telemetry &telemetry, Trajectories &trajectories, HilSwitch &hil)
        : shared_(shared), parameters_(parameters), telemetry_(telemetry), trajectories_(trajectories), hil_(hil) {}

    void on_command_long(const Frame &frame, const Sender &sender);
    void on_command_int(const Frame &frame, const Sender &sender);
    void on_set_mode(const Frame &frame, const Sender &sender);
    /// The control loop begins anew, on another bus: whoever waits for a scan is told that no result comes.
    void restart();
    /// Send the result of an I2C scan that has come to its end.
    void serve();

private:
    struct Command {
        uint16_t id = 0;
        float param[4] = {};
        Sender sender;
        int32_t receipt = 0;
        bool stops = false; ///< its answer goes before all others
    };
    void handle(const Command &command);
    uint8_t run(const Command &command);
    uint8_t run_own(const Command &command);
    uint8_t run_motion(const Command &command);
    uint8_t arm_disarm(float wanted, size_t link);
    uint8_t arm(size_t link);
    void warn_of_missing_pin();
    uint8_t disarm();
    uint8_t stop(uint32_t event);
    uint8_t estop();
    uint8_t estop_command(float stop);
    uint8_t hil_command(float enable, size_t link);
    uint8_t clear_estop();
    uint8_t set_mode(float mode);
    uint8_t set_pose(const omni_pose_t &pose);
    uint8_t reboot(float what);
    uint8_t scan_i2c(const Sender &sender);
    uint8_t refuse_pin_test(uint8_t result, const char *why);
    uint8_t test_pin(float duration_s, float release);
    uint8_t request_message(size_t link, float id);

    Shared &shared_;
    Parameters &parameters_;
    Telemetry &telemetry_;
    Trajectories &trajectories_;
    HilSwitch &hil_;
    Sender scan_sender_;
    uint32_t scans_before_ = 0;
    bool pin_said_ = false;
};

} // namespace omni
