// SPDX-License-Identifier: MIT
#include "app/tick/control_loop.h"

#include <cstring>

namespace omni {
void ControlLoop::hold() {
    setpoints_void_before_.store(++order_, std::memory_order_relaxed);
    stop(OMNI_EVENT_TRAJECTORY_STOP);
}

void ControlLoop::request_pin_test(uint32_t ticks, bool release) {
    pin_tester_.request(ticks, release);
    set_pending(pending_pin_test);
}

void ControlLoop::set_setpoint(const omni_setpoint_t &setpoint) {
    setpoints_.writing() = {setpoint, order_};
    setpoints_.publish();
    set_pending(pending_setpoint);
}

void ControlLoop::set_heartbeat(uint64_t time_us) {
    heartbeats_.writing() = time_us;
    heartbeats_.publish();
    set_pending(pending_heartbeat);
}

void ControlLoop::excite(const omni_excitation_t &excitation) {
    excitations_.writing() = excitation;
    excitations_.publish();
    set_pending(pending_excitation);
}

bool ControlLoop::request(Request request) {
    request.order = ++order_;
    const bool done = requests_.push(request);
    set_pending(pending_request);
    return done;
}

bool ControlLoop::offer_fix(const omni_pose_fix_t &fix) {
    const bool done = fixes_.push(fix);
    set_pending(pending_fix);
    return done;
}

bool ControlLoop::request_event(uint32_t events) {
    Request wanted;
    wanted.event = events;
    return request(wanted);
}

void ControlLoop::restart() {
    bool released = false;
    for (const Request *request = requests_.front(); request != nullptr; request = requests_.front()) {
        released = released || (request->event & OMNI_EVENT_ESTOP_CLEAR) != 0;
        requests_.drop();
    }
    while (fixes_.front() != nullptr) {
        fixes_.drop();
    }
    fixes_seen_ = 0;
    had_fix_ = false;
    fix_report.writing() = {};
    fix_report.publish();
    flags_.fetch_and(OMNI_EVENT_ESTOP);
    if (robot_.supervisor.state == OMNI_STATE_ESTOP && !released) {
        stop(OMNI_EVENT_ESTOP);
    }
    plans.withdraw();
    burst.restart();
    if (const RobotSetup *latest = setups.take()) {
        setup_ = latest;
    }
    inputs_ = {};
    outputs_ = &report.writing().outputs;
    *outputs_ = {};
    driver_ = &drivers_.of(setup_->wiring.driver);
    driver_->restart();
    driver_->set_wiring(setup_->wiring);
    driver_was_ready_ = false;
    scan_.restart();
    pin_tester_.restart();
    powered_ = false;
    ticks_ = 0;
    omni_robot_init(&robot_, &setup_->config);
}

/// Invalidate earlier setpoints, including the current one.
void ControlLoop::forget_setpoints(uint32_t before) {
    inputs_.setpoint.kind = OMNI_SETPOINT_NONE;
    oldest_valid_ = before;
}

void ControlLoop::apply(const Request &request) {
    switch (request.kind) {
    case Request::Kind::event:
        if ((request.event & OMNI_EVENT_ARM) != 0 && outputs_->state != OMNI_STATE_ARMED) {
            forget_setpoints(request.order); // setpoints from before the last disarm must not move it again
        }
        inputs_.events |= request.event;
        break;
    case Request::Kind::set_pose:
        inputs_.pose = request.pose;
        inputs_.events |= OMNI_EVENT_SET_POSE;
        break;
    case Request::Kind::i2c_scan:
        // The driver initialises its chip again afterwards; arming is refused until then.
        if (outputs_->state != OMNI_STATE_ARMED && scan_.start()) {
            driver_was_ready_ = false;
        }
        break;
    }
}

void ControlLoop::process_requests() {
    for (const Request *request = requests_.front(); request != nullptr; request = requests_.front()) {
        apply(*request);
        requests_.drop();
    }
}

void ControlLoop::process_pending_data(uint32_t flags) {
    if ((flags & pending_heartbeat) != 0 && heartbeats_.update()) {
        inputs_.heartbeat_us = heartbeats_.reading();
    }
    if ((flags & pending_setpoint) != 0 && setpoints_.update() &&
        static_cast<int32_t>(setpoints_.reading().order - oldest_valid_) >= 0) {
        inputs_.setpoint = setpoints_.reading().setpoint;
    }
    if ((flags & pending_pin_test) != 0 && !pin_tester_.begin(*outputs_, setup_->config.kinematics.wheels)) {
        inputs_.events |= OMNI_EVENT_DISARM;
    }
    if ((flags & pending_excitation) != 0 && excitations_.update()) {
        start_pending_excitation();
    }
}

void ControlLoop::start_pending_excitation() {
    const uint8_t wheels = setup_->config.kinematics.wheels;
    if (omni_excitation_start(&robot_.excitation, &excitations_.reading(), wheels) == OMNI_OK) {
        burst.trigger();
    }
}

/// Process one fix per tick; its result is published in the next tick, which is flagged for that.
void ControlLoop::process_fix() {
    if (had_fix_) {
        report_fix();
    }
    const omni_pose_fix_t *fix = fixes_.front();
    inputs_.has_fix = fix != nullptr;
    had_fix_ = inputs_.has_fix;
    if (fix != nullptr) {
        inputs_.fix = *fix;
        fixes_.drop();
        set_pending(pending_fix);
        const omni_pose_ekf_state_t &ekf = robot_.estimator.pose_ekf;
        accepted_before_ = ekf.accepted;
        refused_before_ = ekf.refused;
        nis_before_ = ekf.nis;
    }
}

/// Publish the result of the previous tick's fix. The filter's innovation changes with every fix of a usable time.
void ControlLoop::report_fix() {
    FixReport &out = fix_report.writing();
    out.pose = inputs_.fix.pose;
    out.number = ++fixes_seen_;
    out.age_s = static_cast<float>(static_cast<int32_t>(outputs_->time_us - inputs_.fix.time_us)) * 1e-6f;
    if (outputs_->fixes_accepted != accepted_before_) {
        out.use = FixUse::used;
    } else if (outputs_->fixes_refused == refused_before_) {
        out.use = FixUse::ignored;
    } else {
        out.use = outputs_->nis != nis_before_ ? FixUse::too_far : FixUse::unusable;
    }
    fix_report.publish();
}

/// @param flags stops are added to the tick's events before anything else. A request from before a stop is then in the
/// same tick, where the stop has priority.
void ControlLoop::process_events(uint32_t flags) {
    constexpr uint32_t unordered = pending_heartbeat | pending_setpoint | pending_pin_test | pending_excitation;
    constexpr uint32_t news = unordered | pending_request | pending_fix;
    inputs_.events = flags & ~news;
    if ((flags & OMNI_EVENT_TRAJECTORY_STOP) != 0) {
        omni_stop_trajectory(&inputs_);
        oldest_valid_ = setpoints_void_before_.load(std::memory_order_relaxed);
    }
    if ((flags & pending_request) != 0) {
        process_requests();
    }
    if ((flags & unordered) != 0) {
        process_pending_data(flags);
    }
    if ((flags & pending_fix) != 0) {
        process_fix();
    }
}

void ControlLoop::process_pending() {
    inputs_.events = 0;
    inputs_.has_fix = false;
    if (flags_.load(std::memory_order_relaxed) != 0) {
        process_events(flags_.exchange(0, std::memory_order_acq_rel));
    }
}

void ControlLoop::process_plan() {
    if (const omni_trajectory_t *plan = plans.take()) {
        omni_start_trajectory(&inputs_, plan);
        inputs_.setpoint.time_us = inputs_.time_us;
    }
}

/// Change the motor driver: the previous one is switched off, the new one starts from an unknown state.
void ControlLoop::use_wiring(MotorWires &wires) {
    MotorDriver &wanted = drivers_.of(setup_->wiring.driver);
    if (&wanted != driver_) {
        driver_->all_off(wires);
        driver_ = &wanted;
        driver_->restart();
        driver_was_ready_ = false;
    }
    driver_->set_wiring(setup_->wiring);
}

bool ControlLoop::release(MotorWires &wires) {
    powered_ = false;
    wires.enable.set(false);
    return driver_->all_off(wires);
}

/// Output to the bridges by the driver and, independently, by the output-enable pin.
void ControlLoop::drive(MotorWires &wires, uint64_t now_us) {
    driver_->drive(wires, now_us, outputs_->duty, outputs_->drive);
    driver_was_ready_ = driver_was_ready_ || driver_->ready();
    powered_ = driver_->ready() && omni_may_power_motors(outputs_->drive, powered_, driver_->failures());
    wires.enable.set(powered_);
}

void ControlLoop::publish(const TickSensors &sensors, I2cBus &bus) {
    TickReport &out = report.writing();
    const bool armed = out.outputs.state == OMNI_STATE_ARMED; // it cannot be armed again
    out.arming_faults = armed ? static_cast<uint32_t>(OMNI_FAULT_CONFIG) : omni_robot_arming_faults(&robot_);
    out.ticks = ticks_;
    out.overruns = sensors.overruns;
    out.i2c_errors = driver_->errors();
    // Only after persistent failures, to save the call in most ticks.
    out.read_back_missing = inputs_.driver_failures == UINT16_MAX && driver_->read_back_missing();
    out.battery_V = sensors.battery_V;
    out.tick_us_mean = duration_.mean_us();
    out.tick_us_max = duration_.max_us();
    out.tick_jitter_us_max = sensors.jitter_us;
    out.fix_us = robot_.estimator.pose_ekf.last_fix_us;
    out.noise_factor = robot_.estimator.pose_ekf.noise_factor;
    out.fix_factor = robot_.estimator.pose_ekf.fix_noise_factor;
    out.fix_restarts = robot_.estimator.pose_ekf.restarts;
    std::memcpy(out.counts, sensors.counts, sizeof out.counts);
    std::memcpy(out.volt_us, voltages_.volt_us(), sizeof out.volt_us);
    std::memcpy(out.encoder_errors, sensors.encoder_errors, sizeof out.encoder_errors);
    out.i2c = bus.stats();
    out.i2c_found = scan_.found();
    if (burst.recording()) {
        out.last_tick_ns = duration_.last_ns();
        burst.sample(out);
    }
    report.publish();
}

void ControlLoop::tick(const TickSensors &sensors, MotorWires &wires, Clock &stopwatch) {
    const uint64_t begin_ns = stopwatch.stopwatch_ns();
    inputs_.time_us = sensors.time_us;
    if (const RobotSetup *latest = setups.take()) {
        setup_ = latest;
        omni_robot_set_config(&robot_, &setup_->config);
        use_wiring(wires);
    }
    process_pending();
    process_plan();
    pin_tester_.prepare(inputs_, setup_->config.limits);
    sensors.to_inputs(&inputs_);
    if (!scan_.running()) {
        driver_->poll(wires);
    }
    inputs_.driver_failures = driver_->failures();
    // No arming before the first initialisation: nothing could stop a motor.
    inputs_.faults = sensors.faults | (driver_was_ready_ ? 0u : static_cast<uint32_t>(OMNI_FAULT_DRIVER));
    outputs_ = &report.writing().outputs;
    omni_robot_tick(&robot_, &inputs_, outputs_);
    if (scan_.running()) {
        powered_ = false;
        scan_.step(*driver_, wires);
    } else if (pin_tester_.run(wires.enable, outputs_->drive)) {
        powered_ = false;
    } else {
        drive(wires, sensors.time_us);
    }
    ++ticks_;
    publish(sensors, wires.bus);
    voltages_.add(outputs_->voltage_V, setup_->config.kinematics.wheels);
    duration_.record(stopwatch.stopwatch_ns() - begin_ns);
}

} // namespace omni
