// SPDX-License-Identifier: MIT
/// @file control_loop.h  The tick's side of the firmware: control core, motor driver, and what they are told and tell.
///
/// tick() runs in interrupt context. Everything goes in through request(), setups and plans, and comes out through report.
#pragma once

#include <cstdint>

#include "app/board.h"
#include "app/core.h"
#include "app/i2c_scan.h"
#include "app/pca9685.h"
#include "app/snapshot.h"

namespace omni {

/// What a parameter set becomes for the tick.
struct RobotSetup {
    omni_robot_config_t config{};
    Wiring wiring;
};

/// Stop the motors by the output-enable pin alone: the bus rests, so the chip goes on with its last duties. Then disarm.
struct PinTest {
    static constexpr float max_duty = 0.3f; ///< of any wheel when it begins, which needs open-loop duties
    static constexpr float min_s = 0.1f;
    static constexpr float max_s = 2.0f;
    uint32_t ticks = 0;   ///< left; 0: no test
    bool release = false; ///< true: let go of the pin, so that its pull-up is tested as well; false: drive it to off
};

/// One thing the background asks of the tick. They are done in order.
struct Request {
    enum class Kind : uint8_t { event, setpoint, fix, heartbeat, set_pose, i2c_scan, pin_test };
    Kind kind = Kind::event;
    uint32_t event = 0;   ///< omni_event_t bits
    uint64_t time_us = 0; ///< heartbeat: arrival
    omni_setpoint_t setpoint{};
    omni_pose_fix_t fix{};
    omni_pose_t pose{};
    PinTest pin_test;
};

/// What the sensors say at one tick.
struct TickSensors {
    uint64_t time_us = 0; ///< robot clock
    int32_t counts[OMNI_MAX_WHEELS] = {};
    uint8_t counts_valid = 0;
    float battery_V = 0.0f; ///< <= 0: not measured
    uint32_t faults = 0;    ///< OMNI_FAULT_OVERRUN
    uint32_t overruns = 0;  ///< ticks that missed their time since boot
    uint32_t encoder_errors[OMNI_MAX_WHEELS] = {};
    float jitter_us = 0.0f; ///< TickJitter::max_us(); 0 in host-in-the-loop
};

/// What the background gets to know of a tick.
struct TickReport {
    omni_outputs_t outputs{};
    uint32_t arming_faults = OMNI_FAULT_CONFIG; ///< 0: arming is possible
    uint32_t ticks = 0;
    uint32_t overruns = 0;
    uint32_t i2c_errors = 0;
    float battery_V = 0.0f;    ///< as measured
    float tick_us_mean = 0.0f; ///< of the last complete window of ticks
    float tick_us_max = 0.0f;
    float tick_jitter_us_max = 0.0f; ///< spread of the ticks' starts in that window; 0 in host-in-the-loop
    int32_t counts[OMNI_MAX_WHEELS] = {};
    uint32_t volt_us[OMNI_MAX_WHEELS] = {}; ///< 1e-6 V s put on the motors before this tick, modulo 2^32
    uint32_t encoder_errors[OMNI_MAX_WHEELS] = {};
    I2cStats i2c;
    I2cFound i2c_found;
};

class ControlLoop {
public:
    /// Start over: core, driver, requests; the latest setup stays. Only while no tick can run.
    void restart();
    /// Background: queue a request. @return false if the queue is full (nothing is done then).
    bool request(const Request &request) { return requests_.push(request); }
    bool request_event(uint32_t events);

    /// @param pin the driver's output enable, set in every tick. @param stopwatch for measuring how long the tick takes.
    void tick(const TickSensors &sensors, I2cBus &bus, OutputEnable &pin, Clock &stopwatch);
    /// Leave the outputs of this bus off. @return false if the bus is busy.
    bool release(I2cBus &bus, OutputEnable &pin);

    Handover<RobotSetup> setups;
    Handover<omni_trajectory_t> plans;
    Snapshot<TickReport> report;

private:
    void take_requests();
    void take_plan();
    bool apply(const Request &request);
    void begin_scan();
    void begin_pin_test(const PinTest &test);
    void prepare_pin_test();
    bool test_pin(OutputEnable &pin);
    void scan(I2cBus &bus, OutputEnable &pin);
    void drive(I2cBus &bus, OutputEnable &pin, uint64_t now_us);
    void measure(uint64_t duration_ns);
    void integrate_voltage();
    void publish(const TickSensors &sensors, I2cBus &bus);

    static constexpr uint32_t window_ticks = 1000;
    static constexpr uint8_t silence_attempts = 10;
    const RobotSetup *setup_ = nullptr;
    omni_robot_t robot_{};
    omni_inputs_t inputs_{};
    omni_outputs_t *outputs_ = &report.writing().outputs; ///< of the last tick, in its report: only the tick writes there
    Pca9685 driver_;
    I2cScan scan_;
    uint8_t silencing_ = 0; ///< ticks that a scan still waits for the bus to take "all off"
    PinTest pin_test_;
    bool driver_was_ready_ = false;
    bool powered_ = false; ///< the output-enable pin is on
    Queue<Request, 32> requests_;
    uint32_t volt_us_[OMNI_MAX_WHEELS] = {};
    uint32_t ticks_ = 0;
    uint32_t window_count_ = 0;
    uint64_t window_sum_ns_ = 0;
    uint64_t window_max_ns_ = 0;
    float tick_us_mean_ = 0.0f;
    float tick_us_max_ = 0.0f;
};

} // namespace omni
