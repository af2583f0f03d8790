// SPDX-License-Identifier: MIT
/// @file control_loop.h  The tick's side of the firmware: control core, motor driver, and what they are told and tell.
///
/// tick() runs in interrupt context. What goes in has a path of its own, so that nothing waits behind something else:
///
///     stop(), hold(), test_pin()      flags that the next tick looks at first; they cannot be full
///     set_setpoint(), set_heartbeat() the newest counts
///     excite()                        the newest counts; a stop or hold() in the same tick wins
///     offer_fix()                     one per tick, two wait
///     request()                       commands, all of them in the next tick
///     setups, plans                   the newest counts
///
/// Set-points do not wait in the order of the commands, so each is numbered by what was asked before it. One from
/// before an arming or a hold() is void. What comes out is in report.
#pragma once

#include <atomic>
#include <cstdint>
#include <cstring>

#include "app/base/board.h"
#include "app/base/core.h"
#include "app/base/snapshot.h"
#include "app/drivers/motor_drivers.h"
#include "app/tick/burst_recorder.h"
#include "app/tick/i2c_scan.h"
#include "app/tick/robot_setup.h"
#include "app/tick/tick_report.h"

namespace omni {

/// Stop the motors by the output-enable pin alone: the bus rests, so the chip goes on with its last duties. Then
/// disarm.
struct PinTest {
    static constexpr float max_duty = 0.3f; ///< of any wheel when it begins, which needs open-loop duties
    static constexpr float min_s = 0.1f;
    static constexpr float max_s = 2.0f;
    uint32_t ticks = 0;   ///< left; 0: no test
    bool release = false; ///< true: let go of the pin, so that its pull-up is tested as well; false: drive it to off
};

/// One thing the background asks of the tick. They are done in order.
struct Request {
    enum class Kind : uint8_t { event, set_pose, i2c_scan };
    Kind kind = Kind::event;
    uint32_t event = 0; ///< omni_event_t bits; those that stop go to stop()
    uint32_t order = 0; ///< set by the loop
    omni_pose_t pose{};
};

/// What the sensors say at one tick. The readings and their copies come from [sensors] of shared/world.toml.
struct TickSensors {
    uint64_t time_us = 0; ///< robot clock
#include "omni/tick_readings_gen.h"
    uint32_t faults = 0;   ///< OMNI_FAULT_OVERRUN
    uint32_t overruns = 0; ///< ticks that missed their time since boot
    uint32_t encoder_errors[OMNI_MAX_WHEELS] = {};
    float jitter_us = 0.0f; ///< TickJitter::max_us(); 0 in host-in-the-loop
};

class ControlLoop {
public:
    /// Start over: core, driver, requests; the latest setup stays. So does an emergency stop, which the first tick
    /// comes up in: only a release leads out. Only while no tick can run.
    void restart();
    /// OMNI_EVENT_DISARM, OMNI_EVENT_ESTOP or both: done by the next tick, whatever else waits for it. From any
    /// context.
    void stop(uint32_t events) { tell(events); }
    /// These stops are still to be done.
    bool stopping(uint32_t events) const { return (flags_.load(std::memory_order_relaxed) & events) != 0; }
    /// Background: hold the pose from the next tick on (OMNI_EVENT_TRAJECTORY_STOP); set-points from before are void.
    void hold();
    /// Background: a test that cannot begin in the next tick disarms instead if motors are driven.
    void test_pin(const PinTest &test);
    /// Background: the set-point from the next tick on; it replaces one that no tick has seen.
    void set_setpoint(const omni_setpoint_t &setpoint);
    /// Background: arrival of the latest heartbeat that counts, robot clock.
    void set_heartbeat(uint64_t time_us);
    /// Background: @return false if two wait already; the fix is not taken then.
    bool offer_fix(const omni_pose_fix_t &fix);
    /// Background: queue a request. @return false if the queue is full (nothing is done then).
    bool request(Request request);
    bool request_event(uint32_t events);

    /// @param wires to the motors; the output enable is set in every tick. @param stopwatch for measuring how long the
    /// tick takes.
    void tick(const TickSensors &sensors, MotorWires &wires, Clock &stopwatch);
    /// Leave these motors off. @return false if that could not be sent now.
    bool release(MotorWires &wires);

    /// Background: add this to the loop from the next tick on, and begin a burst that waits for it. All zero: end the
    /// one that goes on.
    void excite(const omni_excitation_t &excitation);

    Handover<RobotSetup> setups;
    Handover<omni_trajectory_t> plans;
    Snapshot<TickReport> report;
    BurstRecorder burst;            ///< of what the report says
    Snapshot<FixReport> fix_report; ///< of the latest fix; it comes only in the tick after one

private:
    struct OrderedSetpoint {
        omni_setpoint_t setpoint{};
        uint32_t order = 0;
    };

    void tell(uint32_t flags) { flags_.fetch_or(flags, std::memory_order_release); }
    void take_what_waits();
    void take_flags(uint32_t flags);
    void take_requests();
    void take_news(uint32_t flags);
    void take_excitation();
    void take_fix();
    void report_fix();
    void take_plan();
    void apply(const Request &request);
    void forget_setpoints(uint32_t before);
    void begin_scan();
    void begin_pin_test(uint32_t wanted);
    void prepare_pin_test();
    bool test_pin(OutputEnable &pin);
    void use_wiring(MotorWires &wires);
    void scan(MotorWires &wires);
    void drive(MotorWires &wires, uint64_t now_us);
    void measure(uint64_t duration_ns);
    void integrate_voltage();
    void publish(const TickSensors &sensors, I2cBus &bus);

    static constexpr uint32_t window_ticks = 1000;
    static constexpr uint8_t silence_attempts = 10;
    const RobotSetup *setup_ = nullptr;
    omni_robot_t robot_{};
    omni_inputs_t inputs_{};
    omni_outputs_t *outputs_ =
        &report.writing().outputs; ///< of the last tick, in its report: only the tick writes there
    MotorDrivers drivers_;
    MotorDriver *driver_ = &drivers_.of(0); ///< the one in use
    I2cScan scan_;
    uint8_t silencing_ = 0; ///< ticks that a scan still waits for the bus to take "all off"
    PinTest pin_test_;
    bool driver_was_ready_ = false;
    bool powered_ = false; ///< the output-enable pin is on
    /// Bits for the next tick beside those of omni_event_t: where it must look.
    enum News : uint32_t {
        news_excitation = 1u << 26,
        news_request = 1u << 27,
        news_fix = 1u << 28,
        news_pin_test = 1u << 29,
        news_heartbeat = 1u << 30,
        news_setpoint = 1u << 31
    };
    std::atomic<uint32_t> flags_{0};           ///< omni_event_t and News
    std::atomic<uint32_t> void_before_{0};     ///< with OMNI_EVENT_TRAJECTORY_STOP: the order of the latest hold()
    std::atomic<uint32_t> pin_test_wanted_{0}; ///< with news_pin_test: ticks * 2 + release
    Snapshot<OrderedSetpoint> setpoints_;
    Snapshot<uint64_t> heartbeats_;
    Snapshot<omni_excitation_t> excitations_;
    Queue<omni_pose_fix_t, 2> fixes_;
    Queue<Request, 32> requests_;
    uint32_t order_ = 0;        ///< background: rises with each request and hold()
    uint32_t oldest_valid_ = 0; ///< tick: order of the oldest set-point that is not void
    uint32_t volt_us_[OMNI_MAX_WHEELS] = {};
    uint32_t ticks_ = 0;
    uint32_t window_count_ = 0;
    uint64_t window_sum_ns_ = 0;
    uint64_t window_max_ns_ = 0;
    uint32_t last_tick_ns_ = 0;
    float tick_us_mean_ = 0.0f;
    float tick_us_max_ = 0.0f;
    bool looked_at_fix_ = false;   ///< the tick before had one
    uint32_t fixes_seen_ = 0;      ///< by the tick
    uint32_t accepted_before_ = 0; ///< the pose filter's counters and innovation, before the tick that has a fix
    uint32_t refused_before_ = 0;
    float nis_before_ = 0.0f;
};

} // namespace omni
