// SPDX-License-Identifier: MIT
/// @file commands.h  COMMAND_LONG, COMMAND_INT and SET_MODE. Every command is acknowledged; an unknown one as
/// UNSUPPORTED.
///
/// Arm and disarm are one command, and COMMAND_ACK does not contain its parameters: a delayed acknowledgement of "arm"
/// is indistinguishable from that of "disarm". So a client may number its commands in param5, which no command uses;
/// COMMAND_ACK.result_param2 is then a receipt: the CRC-32 of all seven parameters as received. Without a number it is
/// 0.
///
/// A retransmission (COMMAND_LONG.confirmation > 0) of a numbered command that was accepted is acknowledged only. Stops
/// and holds are always executed. After one, a retransmission of an earlier command that starts a motion or releases an
/// e-stop is denied (CommandMemory).
#pragma once

#include "app/link/command_memory.h"
#include "app/link/flight_mode.h"
#include "app/services/arming.h"
#include "app/services/burst_log.h"
#include "app/services/excitations.h"
#include "app/services/parameter_trial.h"
#include "app/services/parameters.h"
#include "app/services/scan_service.h"
#include "app/services/setpoints.h"
#include "app/services/telemetry.h"
#include "app/services/trajectories.h"

namespace omni {

class Commands {
public:
    /// Services that execute the commands.
    struct Services {
        Arming &arming;
        Heartbeats &heartbeats;
        const Setpoints &setpoints;
        Parameters &parameters;
        Telemetry &telemetry;
        Trajectories &trajectories;
        ScanService &scan;
        BurstLog &burst_log;
        Excitations &excitations;
        ParameterTrial &trial;
        HilSwitch &hil;
    };

    Commands(OutputEnable &output_enable, const RobotClock &clock, Links &links, Texts &texts, RobotState &robot,
             ControlLoop &control, const Services &services)
        : output_enable_(output_enable), clock_(clock), links_(links), texts_(texts), robot_(robot), control_(control),
          services_(services) {}

    void on_command_long(const Frame &frame, const Sender &sender);
    void on_command_int(const Frame &frame, const Sender &sender);
    void on_set_mode(const Frame &frame, const Sender &sender);

private:
    struct Command {
        uint16_t id = 0;
        float param[6] = {}; ///< 1 to 4, 6 and 7
        Sender sender;
        int32_t receipt = 0;
        bool stops = false;    ///< acknowledge with Priority::stop
        bool repeated = false; ///< retransmission: confirmation > 0
    };
    enum class Effect : uint8_t {
        other,
        begins, ///< starts a motion or releases a stop
        ends,   ///< ends a motion
    };
    static Effect effect_of(const Command &command);
    void handle(const Command &command);
    uint8_t execute_or_deny(const Command &command);
    uint8_t run(const Command &command);
    uint8_t run_omni_command(const Command &command);
    uint8_t run_motion(const Command &command);
    uint8_t hil_command(float enable, size_t link);
    uint8_t set_mode(ModeRequest mode, const Sender &sender);
    uint8_t follow_setpoints(const Sender &sender);
    void record_motion(bool holds, const Sender &sender);
    uint8_t storage(float action);
    uint8_t set_pose(const omni_pose_t &pose);
    uint8_t reboot(float what);
    uint8_t refuse_pin_test(uint8_t result, const char *why);
    uint8_t test_pin(float duration_s, float release);
    uint8_t request_message(size_t link, float id);

    OutputEnable &output_enable_;
    const RobotClock &clock_;
    Links &links_;
    Texts &texts_;
    RobotState &robot_;
    ControlLoop &control_;
    const Services services_;
    CommandMemory memory_;
};

} // namespace omni
