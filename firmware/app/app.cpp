// SPDX-License-Identifier: MIT
#include "app/app.h"

#include <algorithm>
#include <iterator>

#include "app/base/flash_code.h"
#include "app/services/status_light.h"

namespace omni {
namespace {

constexpr uint64_t late_us = OMNI_TICK_US + OMNI_TICK_US / 2;
constexpr uint32_t overruns_tolerated = 10;
/// Timeout of sensor messages in hardware-in-the-loop. The robot's own motors are off, and a busy computer may be late
/// by some tenths of a second.
constexpr uint64_t hil_stop_timeout_us = 1'000'000;
constexpr uint64_t hil_timeout_us = 10'000'000;
/// Maximum wait for a busy bus.
constexpr uint32_t release_limit = 50;

} // namespace

OMNI_COLD App::App(const Board &board, bool lockstep)
    : board_(board), wires_{*board_.i2c, *board_.output_enable, board_.motor_pins}, texts_(links_, clock_),
      robot_(texts_), signing_(*board_.storage), heartbeats_(texts_, clock_, robot_, control_),
      button_(board_.stop_button, control_), lockstep_(lockstep),
      signing_service_(signing_, links_, texts_, clock_, robot_), stop_latch_(*board_.storage),
      parameters_(board_, links_, texts_, robot_, control_, *this),
      trial_(board_, texts_, clock_, robot_, heartbeats_, parameters_),
      telemetry_(links_, {board_, clock_, robot_, links_, signing_, legacy_line_, parameters_}),
      trajectories_(texts_, clock_, robot_, heartbeats_, control_, parameters_),
      excitations_(texts_, robot_, control_, parameters_), setpoints_(texts_, clock_, robot_, control_, parameters_),
      pose_fixes_(texts_, clock_, robot_, control_, parameters_),
      status_texts_(links_, texts_, clock_, robot_, heartbeats_, button_, parameters_, board_.gyro_chip,
                    board_.flow_chip),
      scan_(links_, texts_, clock_, robot_, control_, *this),
      burst_log_(board_, links_, texts_, robot_, control_, parameters_),
      arming_({*board_.output_enable, scan_, *this}, texts_, robot_, control_, heartbeats_, button_, signing_,
              trajectories_),
      commands_(*board_.output_enable, clock_, links_, texts_, robot_, control_,
                {arming_, heartbeats_, setpoints_, parameters_, telemetry_, trajectories_, scan_, burst_log_,
                 excitations_, trial_, *this}),
      owner_(lockstep ? Owner::background : Owner::timer) {
    attach_links();
    robot_.set_hil(lockstep);
    signing_service_.boot();
    parameters_.boot();
    if (stop_latch_.boot() != StopLatch::AtBoot::released) {
        control_.stop(OMNI_EVENT_ESTOP);
    }
    button_.check();
    restart_control(lockstep ? 0 : board_.clock->now_us());
}

void App::attach_links() {
    links_.attach(board_, signing_);
    links_.set_unlimited(lockstep_);
    for (size_t i = 0; i < links_.count() && line_link_ == no_link; ++i) {
        if (links_[i].is_radio()) {
            line_link_ = i; // first radio only: one parser cannot separate two streams
            links_[i].set_text(&legacy_line_);
        }
    }
}

OMNI_COLD void App::parameters_changed() {
    const omni_real_t *values = parameters_.values();
    heartbeats_.stations.set_timeout(static_cast<uint64_t>(values[OMNI_PARAM_SAFE_LINK_TO] * 1e6f));
    if (board_.gyro_chip != nullptr) {
        set_gyro_axis(static_cast<int8_t>(values[OMNI_PARAM_GYRO_AXIS]));
    }
    if (board_.flow_chip != nullptr) {
        enable_flow_chip(values[OMNI_PARAM_FLOW_MODE] > 0.0f);
    }
    for (size_t i = 0; i < board_.port_count; ++i) {
        links_[i].set_system(static_cast<uint8_t>(values[OMNI_PARAM_SYS_ID]));
        links_[i].set_budget(values[OMNI_PARAM_LINK1_BUDGET + i]);
        const float rates[3] = {values[OMNI_PARAM_SR1_STATE + i], values[OMNI_PARAM_SR1_WHEELS + i],
                                values[OMNI_PARAM_SR1_STATUS + i]};
        if (!std::equal(rates, rates + 3, rates_[i])) {
            std::copy(rates, rates + 3, rates_[i]);
            telemetry_.set_rates(i, values);
        }
        if (links_[i].is_radio()) {
            links_[i].set_baud(static_cast<uint32_t>(values[OMNI_PARAM_LINK2_BAUD]));
        }
    }
}

void App::update_overruns(TickSensors *sensors) {
    const bool late = last_tick_us_ != 0 && sensors->time_us - last_tick_us_ > late_us;
    last_tick_us_ = sensors->time_us;
    overruns_ += late ? 1 : 0;
    overruns_in_row_ = late ? overruns_in_row_ + 1 : 0;
    sensors->overruns = overruns_;
    sensors->faults = overruns_in_row_ >= overruns_tolerated ? static_cast<uint32_t>(OMNI_FAULT_OVERRUN) : 0u;
}

void App::tick() {
    const Owner owner = owner_.load(std::memory_order_acquire);
    if (owner != Owner::timer) {
        button_.check(); // the robot's own button, also in hardware-in-the-loop
    }
    if (owner == Owner::background) {
        board_.output_enable->set(false); // the simulated robot moves, not this one
        return;
    }
    if (owner == Owner::handing_over) {
        if (control_.release(wires_) || ++release_attempts_ >= release_limit) {
            owner_.store(Owner::background, std::memory_order_release);
        }
        return;
    }
    jitter_.record_start(board_.clock->stopwatch_ns());
    TickSensors sensors;
    sensors.jitter_us = jitter_.max_us();
    sensors.time_us = board_.clock->now_us();
    sensors.counts_valid = board_.encoders->read(sensors.counts);
    sensors.battery_V = board_.battery_V != nullptr ? board_.battery_V() : 0.0f;
    sensors.from_board(board_);
    if (board_.gyro_chip != nullptr) {
        read_gyro(&sensors);
    }
    if (board_.flow_chip != nullptr) {
        read_flow(&sensors);
    }
    board_.encoders->errors(sensors.encoder_errors);
    update_overruns(&sensors);
    button_.check(); // last of the sensors: the tick's own first look is at the flag that this sets
    control_.tick(sensors, wires_, *board_.clock);
}

/// Restart with another clock. Only while no tick runs.
void App::restart_control(uint64_t now_us) {
    control_.restart();
    control_.report.update();
    control_.fix_report.update();
    robot_.restart(control_.stopping(OMNI_EVENT_ESTOP));
    button_.reset_simulated();
    clock_.now_us = now_us;
    jitter_.restart();
    last_tick_us_ = 0;
    overruns_in_row_ = 0;
    hil_heard_us_ = board_.clock->now_us();
    hil_.restart();
    telemetry_.restart();
    trajectories_.restart();
    heartbeats_.stations.restart();
    setpoints_.restart();
    pose_fixes_.restart();
    status_texts_.restart();
    scan_.restart();
}

void App::update_owner() {
    if (!robot_.hil() && owner_.load(std::memory_order_acquire) == Owner::background) {
        robot_.set_hil(true);
        restart_control(0);
    }
}

/// Leave hardware-in-the-loop: always possible, over any link, armed or not; ends with motors off.
OMNI_COLD uint8_t App::switch_hil(bool enable, size_t link) {
    if (enable) {
        return enter_hil(link);
    }
    if (lockstep_) {
        texts_.refuse(MAV_SEVERITY_WARNING, Text().add("started in lockstep: cannot leave HIL"));
        return MAV_RESULT_DENIED;
    }
    if (robot_.hil()) {
        if (hil_link_ != link) {
            texts_.say(MAV_SEVERITY_WARNING, Text().add("HIL left: another link requested it"));
        }
        leave_hil();
    }
    return MAV_RESULT_ACCEPTED;
}

/// An e-stop must be released on the real robot, not in a simulation.
const char *App::hil_refusal(size_t link) const {
    if (hil_link_ != no_link && hil_link_ != link) {
        return "in use on another link";
    }
    const bool stopped = robot_.state() == OMNI_STATE_ESTOP || control_.stopping(OMNI_EVENT_ESTOP);
    return stopped && !robot_.hil() ? "release the emergency stop first" : nullptr;
}

uint8_t App::enter_hil(size_t link) {
    if (robot_.armed()) {
        return robot_.refuse_armed("HIL");
    }
    if (const char *why = hil_refusal(link)) {
        texts_.refuse(MAV_SEVERITY_WARNING, Text().add("HIL: ").add(why));
        return MAV_RESULT_DENIED;
    }
    hil_link_ = link;
    hil_session_ = board_.ports[link]->session();
    if (robot_.hil()) {
        restart_control(0);
        return MAV_RESULT_ACCEPTED;
    }
    links_.set_unlimited(true);
    release_attempts_ = 0;
    owner_.store(Owner::handing_over, std::memory_order_release);
    return MAV_RESULT_ACCEPTED;
}

void App::leave_hil() {
    links_.set_unlimited(false);
    hil_link_ = no_link;
    robot_.set_hil(false);
    restart_control(board_.clock->now_us()); // disarmed, and the driver starts with all outputs off
    owner_.store(Owner::timer, std::memory_order_release);
}

/// Leave hardware-in-the-loop if its peer has disconnected.
void App::watch_hil_peer() {
    if (!robot_.hil() || hil_link_ == no_link || board_.ports[hil_link_]->session() == hil_session_) {
        return;
    }
    if (lockstep_) {
        hil_link_ = no_link;
        restart_control(0);
    } else {
        leave_hil();
        texts_.say(MAV_SEVERITY_WARNING, Text().add("HIL left: its link was closed"));
    }
}

/// Uses the board's clock, as the simulated one stands still meanwhile. Not in lockstep, which has no other clock and
/// no motors.
void App::watch_hil_silence() {
    if (!robot_.hil() || lockstep_) {
        return;
    }
    const bool stop_waits = control_.stopping(OMNI_EVENT_DISARM | OMNI_EVENT_ESTOP);
    if (board_.clock->now_us() - hil_heard_us_ > (stop_waits ? hil_stop_timeout_us : hil_timeout_us)) {
        leave_hil();
        texts_.say(MAV_SEVERITY_WARNING, Text().add("HIL left: no sensor messages"));
    }
}

void App::take_report() {
    if (control_.report.update()) {
        robot_.take(control_.report.reading());
        pose_fixes_.take_report();
        if (!robot_.armed()) {
            heartbeats_.stations.release();
        }
    }
    if (control_.fix_report.update()) {
        robot_.take(control_.fix_report.reading());
    }
    robot_.set_setpoint_refused(setpoints_.refused());
    robot_.set_streamed_kind(setpoints_.streamed_kind());
}

void App::on_hil_sensors(const Frame &frame, const Sender &sender) {
    const size_t link = sender.link;
    if (!robot_.hil() || (hil_link_ != no_link && hil_link_ != link)) {
        return;
    }
    hil_link_ = link;
    hil_session_ = board_.ports[link]->session();
    hil_heard_us_ = board_.clock->now_us();
    flush(); // this tick's reports must not depend on the packet boundaries of the host's data
    TickSensors sensors;
    hil_.take(frame, &sensors);
    update_overruns(&sensors);
    button_.check_simulated(hil_.button_open());
    clock_.now_us = sensors.time_us;
    control_.tick(sensors, hil_.wires, *board_.clock);
    take_report();
    pose_fixes_.serve();
    serve();
    hil_.answer(robot_.latest().outputs, links_[link]);
}

/// Report the reset cause on each link, unless it was power-on or a requested reset.
void App::report_reset_cause(size_t link) {
    constexpr const char *texts[] = {nullptr, "restarted by the watchdog", nullptr, "restarted after a crash",
                                     "restarted: the processor was too hot"};
    static_assert(std::size(texts) == static_cast<size_t>(ResetCause::over_temperature) + 1, "one text per cause");
    if (reset_cause_reported_[link]) {
        return;
    }
    reset_cause_reported_[link] = true;
    Watchdog &watchdog = *board_.watchdog;
    if (const char *text = texts[static_cast<size_t>(watchdog.reset_cause())]) {
        texts_.send_to(link, MAV_SEVERITY_CRITICAL, Text().add(text));
    }
    for (size_t i = 0; watchdog.crash_line(i) != nullptr; ++i) {
        texts_.send_to(link, MAV_SEVERITY_CRITICAL, Text().add(watchdog.crash_line(i)));
    }
}

/// Report an e-stop that was active at boot to each new peer.
void App::report_stop_latch(size_t link) {
    if (robot_.state() != OMNI_STATE_ESTOP || stop_latch_.at_boot() == StopLatch::AtBoot::released) {
        return;
    }
    const bool known = stop_latch_.at_boot() == StopLatch::AtBoot::stopped;
    texts_.send_to(link, MAV_SEVERITY_CRITICAL,
                   Text().add(known ? "stopped since before the restart: release it"
                                    : "stop memory unreadable: stopped until released"));
}

/// Store the e-stop. Before a restart also one that no tick has processed yet.
void App::store_stop() {
    const uint8_t state = robot_.state();
    const bool coming = control_.stopping(OMNI_EVENT_ESTOP);
    const bool stopped = state == OMNI_STATE_ESTOP || (robot_.reboot_requested() && coming);
    const bool resting = state == OMNI_STATE_DISARMED && !coming && !robot_.armed();
    stop_latch_.serve(stopped, resting, robot_.reboot_requested(), clock_.now_us);
    if (stop_latch_.failed() && !latch_failure_reported_) {
        texts_.say(MAV_SEVERITY_ERROR, Text().add("the memory failed: a restart may lift the stop"));
    }
    latch_failure_reported_ = stop_latch_.failed();
}

void App::serve() {
    for (size_t i = 0; i < board_.port_count; ++i) {
        links_[i].refill(clock_.now_us);
    }
    store_stop();
    signing_service_.serve();
    status_texts_.serve();
    scan_.serve();
    trial_.serve();
    trajectories_.serve();
    telemetry_.serve();
    parameters_.serve();
    burst_log_.serve();
    texts_.report_suppressed();
}

void App::flush() {
    for (size_t i = 0; i < board_.port_count; ++i) {
        links_[i].flush();
    }
}

void App::update_status_light() {
    if (board_.light != nullptr) {
        const auto state = static_cast<omni_safety_state_t>(robot_.state());
        const bool ground_station = (robot_.latest().arming_faults & OMNI_FAULT_LINK_LOSS) == 0;
        board_.light->set(light_on(state, ground_station, board_.clock->now_us()));
    }
}

void App::background() {
    update_owner();
    if (!robot_.hil()) {
        clock_.now_us = board_.clock->now_us();
    }
    take_report();
    pose_fixes_.serve();
    board_.watchdog->feed();
    receive_all();
    watch_hil_silence();
    if (!robot_.hil() || hil_link_ == no_link) {
        serve(); // in simulated time every frame and every tick serves instead
    }
    flush();
    update_status_light();
}

} // namespace omni
