// SPDX-License-Identifier: MIT
/// @file app.h  The application: composes the modules, runs the tick and the background loop.
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
    /// @param lockstep hardware-in-the-loop from the start and always: tick() is never called. @param board must
    /// outlive the App.
    App(const Board &board, bool lockstep);

    /// The control tick, 1 kHz, interrupt context.
    void tick();
    /// Serve the links; call as often as possible.
    void background();
    /// A reboot was requested, and its acknowledgement has been sent.
    bool reboot_wanted() const { return robot_.reboot_requested(); }
    /// Hardware-in-the-loop with sensor messages received: the next ones follow the answer to this tick.
    bool uses_host_sensors() const { return robot_.hil() && hil_.has_sensors(); }
    /// The host sleeps while it waits for that answer, so polling for its next message is useless.
    bool host_sleeps() const { return hil_.host_sleeps(); }

private:
    /// Context that runs the control loop: the timer interrupt, or in hardware-in-the-loop the background.
    enum class Owner : uint8_t { timer, handing_over, background };

    void parameters_changed() override;
    uint8_t switch_hil(bool enable, size_t link) override;
    bool hil_silent() const override { return robot_.hil() && !hil_.has_sensors(); }

    // Not inlined: the call graph analysis of the image identifies the sensor chips' virtual calls by these callers.
    [[gnu::noinline]] void set_gyro_axis(int8_t axis) { board_.gyro_chip->use_axis(axis); }
    [[gnu::noinline]] void read_gyro(TickSensors *sensors) {
        sensors->gyro_valid = board_.gyro_chip->read(sensors->time_us, sensors->gyro_rad_s);
    }
    [[gnu::noinline]] void enable_flow_chip(bool wanted) { board_.flow_chip->use(wanted); }
    [[gnu::noinline]] void read_flow(TickSensors *sensors) {
        const bool rests = rest_.update(sensors->counts, sensors->time_us);
        sensors->flow_valid = board_.flow_chip->read(sensors->time_us, sensors->flow_moved, rests);
    }
    void update_overruns(TickSensors *sensors);
    void update_owner();
    void restart_control(uint64_t now_us);
    uint8_t enter_hil(size_t link);
    /// @return why hardware-in-the-loop cannot be entered from this link, or nullptr.
    const char *hil_refusal(size_t link) const;
    void leave_hil();
    void watch_hil_peer();
    void watch_hil_silence();
    bool handing_over() const;
    void receive_all();
    void receive(size_t link);
    void process_frames(size_t link);
    void report_reset_cause(size_t link);
    void report_stop_latch(size_t link);
    void store_stop();
    void greet(size_t link);
    /// Report active problems to a peer that has not received them yet.
    void report_status_to_new_peer(size_t link);
    /// Call before a heartbeat is processed: a peer behind a radio that was silent gets active problems again.
    void on_peer_reappeared(size_t link);
    void dispatch(const Frame &frame, const Sender &sender);
    /// May this sender stream setpoints? If not, the refusal is reported to it.
    bool accepts_setpoints_of(const Sender &sender);
    void on_heartbeat(const Frame &frame, const Sender &sender);
    void on_hil_sensors(const Frame &frame, const Sender &sender);
    void attach_links();
    void process_legacy_line(size_t link);
    void apply_legacy_setpoint(const LegacySetpoint &setpoint, const Sender &sender);
    void serve();
    void take_report();
    void flush();
    void update_status_light();

    Board board_;
    MotorWires wires_; ///< the board's interfaces to the motors
    Links links_;
    RobotClock clock_;
    Texts texts_;
    RobotState robot_;
    ControlLoop control_;
    Signing signing_;
    LegacyLine legacy_line_; ///< on the first radio
    Heartbeats heartbeats_;
    ButtonWatch button_;
    RestWatch rest_; ///< for the floor odometry sensor
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
    size_t line_link_ = no_link; ///< link on which setpoint lines of the original robot are parsed
    size_t hil_link_ = no_link;  ///< link of the simulated world
    uint32_t hil_session_ = 0;
    bool latch_failure_reported_ = false;
    uint64_t hil_heard_us_ = 0; ///< board clock: latest sensor message, or start of hardware-in-the-loop
    float rates_[Board::max_ports][3] = {};
    TickJitter jitter_;
    uint64_t last_tick_us_ = 0;
    uint32_t overruns_ = 0;
    uint32_t overruns_in_row_ = 0;
    uint32_t release_attempts_ = 0;
    uint64_t greeted_us_[Board::max_ports] = {}; ///< last report of active problems to a new peer
    bool reset_cause_reported_[Board::max_ports] = {};
};

} // namespace omni
