// SPDX-License-Identifier: MIT
/// @file app.h  The firmware as a whole: composes the modules, owns the tick and the background loop.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "app/base/board.h"
#include "app/base/robot_clock.h"
#include "app/link/legacy_line.h"
#include "app/link/links.h"
#include "app/link/texts.h"
#include "app/services/arming.h"
#include "app/services/burst_log.h"
#include "app/services/button_watch.h"
#include "app/services/commands.h"
#include "app/services/heartbeats.h"
#include "app/services/hil.h"
#include "app/services/hil_switch.h"
#include "app/services/parameters.h"
#include "app/services/pose_fixes.h"
#include "app/services/robot_state.h"
#include "app/services/scan_service.h"
#include "app/services/setpoints.h"
#include "app/services/signing_service.h"
#include "app/services/status_texts.h"
#include "app/services/telemetry.h"
#include "app/services/trajectories.h"
#include "app/tick/rest_watch.h"
#include "app/tick/stop_latch.h"
#include "app/tick/tick_jitter.h"

namespace omni {

class App final : private ParameterListener, private HilSwitch {
public:
    /// @param lockstep host-in-the-loop from the start and always: tick() is never called. @param board must outlive
    /// the App.
    App(const Board &board, bool lockstep);

    /// The control tick, 1 kHz, interrupt context.
    void tick();
    /// Serve the links; call as often as possible.
    void background();
    /// A reboot was asked for and everything about it has been said.
    bool reboot_wanted() const { return robot_.reboot(); }
    /// The host is in the loop and has sent sensors: the next ones are due as soon as it has had this tick's answer.
    bool hosted() const { return robot_.hil() && hil_.heard(); }
    /// It waits for that answer asleep.
    bool host_sleeps() const { return hil_.host_sleeps(); }

private:
    /// Who runs the control loop: the timer's tick, or (once it has let go) the background with the host in the loop.
    enum class Owner : uint8_t { timer, handing_over, background };
    static constexpr size_t no_link = Board::max_ports;

    void parameters_changed() override;
    uint8_t switch_hil(bool enable, size_t link) override;
    bool hil_silent() const override { return robot_.hil() && !hil_.heard(); }

    // Functions of their own: what looks at the image's calls knows by them which may lead to a chip.
    [[gnu::noinline]] void tell_gyro(int8_t axis) { board_.gyro_chip->use_axis(axis); }
    [[gnu::noinline]] void read_gyro(TickSensors *sensors) {
        sensors->gyro_valid = board_.gyro_chip->read(sensors->time_us, sensors->gyro_rad_s);
    }
    [[gnu::noinline]] void tell_flow(bool wanted) { board_.flow_chip->use(wanted); }
    [[gnu::noinline]] void read_flow(TickSensors *sensors) {
        const bool rests = rest_.look(sensors->counts, sensors->time_us);
        sensors->flow_valid = board_.flow_chip->read(sensors->time_us, sensors->flow_moved, rests);
    }
    void watch_overrun(TickSensors *sensors);
    void update_owner();
    void restart_control(uint64_t now_us);
    uint8_t enter_hil(size_t link);
    /// @return why host-in-the-loop cannot be entered from this link, or nullptr.
    const char *hil_obstacle(size_t link) const;
    void leave_hil();
    void watch_hil_peer();
    void watch_hil_silence();
    bool handing_over() const;
    void receive_all();
    void receive(size_t link);
    void take_frames(size_t link);
    void say_restart(size_t link);
    void say_latch(size_t link);
    void store_stop();
    void greet(size_t link);
    /// What is wrong, to somebody who has not heard it.
    void tell_newcomer(size_t link);
    /// Before a heartbeat counts: if it is a newcomer's on a link that was connected long ago, say what is wrong again.
    void meet(size_t link);
    void dispatch(const Frame &frame, const Sender &sender);
    bool dispatch_setpoint(const Frame &frame, const Sender &sender);
    /// Whether a set-point of this sender counts. If not, that is said.
    bool follows(const Sender &sender);
    /// Pose fixes and signs of life.
    bool dispatch_signs(const Frame &frame, const Sender &sender);
    void attach_links();
    void take_legacy_line(size_t link);
    void take_legacy_setpoint(const LegacySetpoint &setpoint, const Sender &sender);
    void hil_tick(const Frame &frame, size_t link);
    void serve();
    void take_report();
    void flush();
    void show_state();

    Board board_;
    MotorWires wires_; ///< the board's
    Links links_;
    RobotClock clock_;
    Texts texts_;
    RobotState robot_;
    ControlLoop control_;
    Signing signing_;
    LegacyLine legacy_line_; ///< on the first radio
    Heartbeats heartbeats_;
    ButtonWatch button_;
    RestWatch rest_; ///< for the sensor of motion over the floor
    const bool lockstep_;
    Hil hil_;
    SigningService signing_service_;
    StopLatch stop_latch_;
    Parameters parameters_;
    ParameterTrial trial_;
    Telemetry telemetry_;
    Trajectories trajectories_;
    Excitations excitations_;
    Setpoints setpoints_;
    PoseFixes pose_fixes_;
    StatusTexts status_texts_;
    ScanService scan_;
    BurstLog burst_log_;
    Arming arming_;
    Commands commands_;
    std::atomic<Owner> owner_;
    size_t line_link_ = no_link; ///< where set-point lines of the original robot are understood
    size_t hil_link_ = no_link;
    uint32_t hil_session_ = 0;
    bool latch_failure_said_ = false;
    uint64_t hil_heard_us_ = 0; ///< board's clock: the host's latest sensors, or when the loop began
    float rates_[Board::max_ports][3] = {};
    TickJitter jitter_;
    uint64_t last_tick_us_ = 0;
    uint32_t overruns_ = 0;
    uint32_t overruns_in_row_ = 0;
    uint32_t release_attempts_ = 0;
    uint64_t greeted_us_[Board::max_ports] = {}; ///< when a link was greeted, or somebody new was met there
    bool restart_said_[Board::max_ports] = {};
};

} // namespace omni
