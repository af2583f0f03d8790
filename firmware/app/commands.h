// SPDX-License-Identifier: MIT
/// @file commands.h  COMMAND_LONG, COMMAND_INT and SET_MODE. Every command is acknowledged; an unknown one as
/// UNSUPPORTED.
///
/// Arm and disarm are the same command, and COMMAND_ACK says nothing of its parameters: a late one of "arm" looks like
/// that of "disarm". So whoever numbers his commands in param5, which none of them uses, gets a receipt.
/// COMMAND_ACK.result_param2 is then the CRC-32 of all seven parameters as they came. Without a number it is 0.
///
/// An answer may get lost, and the command is then sent again, with COMMAND_LONG.confirmation above 0. A numbered one
/// that was accepted is then only answered again. Stops and holds are executed every time. Once one has come, a
/// repetition of an earlier command that begins a motion or releases an emergency stop is denied (CommandMemory).
#pragma once

#include "app/arming.h"
#include "app/burst_log.h"
#include "app/command_memory.h"
#include "app/excitations.h"
#include "app/flight_mode.h"
#include "app/parameter_trial.h"
#include "app/parameters.h"
#include "app/scan_service.h"
#include "app/setpoints.h"
#include "app/telemetry.h"
#include "app/trajectories.h"

namespace omni {

class Commands {
public:
    /// Whom the commands are passed on to.
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
        bool stops = false;    ///< its answer goes before all others
        bool repeated = false; ///< its sender says that it was sent before
    };
    enum class Effect : uint8_t {
        other,
        begins, ///< a motion, or it releases a stop
        ends,   ///< a motion
    };
    static Effect effect_of(const Command &command);
    void handle(const Command &command);
    uint8_t result_of(const Command &command);
    uint8_t run(const Command &command);
    uint8_t run_own(const Command &command);
    uint8_t run_motion(const Command &command);
    uint8_t hil_command(float enable, size_t link);
    uint8_t set_mode(ModeRequest mode, const Sender &sender);
    uint8_t follow_setpoints(const Sender &sender);
    void note_motion(bool holds, const Sender &sender);
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
