// SPDX-License-Identifier: MIT
/// @file control_loop.h  Control loop in the tick: core, motor driver, and their lock-free interface to the background.
///
/// tick() runs in interrupt context. Each kind of input has its own path, so that none waits behind another:
///
///     stop(), hold(), request_pin_test() flags, processed first in the next tick; never full
///     set_setpoint(), set_heartbeat() latest value
///     excite()                        latest value; a stop or hold() in the same tick has priority
///     offer_fix()                     queue of two, one per tick
///     request()                       queue, all in the next tick
///     setups, plans                   latest value
///
/// Setpoints bypass the queue of requests, so each carries the number of the requests before it. One from before an
/// arming or a hold() is void. Outputs are in `report`.
#pragma once

#include <atomic>
#include <cstdint>
#include <cstring>

#include "app/base/board.h"
#include "app/base/core.h"
#include "app/base/snapshot.h"
#include "app/tick/burst_recorder.h"
#include "app/tick/i2c_scan.h"
#include "app/tick/pin_tester.h"
#include "app/tick/robot_setup.h"
#include "app/tick/tick_report.h"
#include "app/tick/tick_statistics.h"
#include "omni/motor_drivers_gen.h"
#include "omni/tick_readings_gen.h"

namespace omni {

/// Request from the background to the tick; executed in order.
struct Request {
    enum class Kind : uint8_t { event, set_pose, i2c_scan };
    Kind kind = Kind::event;
    uint32_t event = 0; ///< omni_event_t bits, except stops
    uint32_t order = 0; ///< sequence number, set by request()
    omni_pose_t pose{};
};

/// Inputs of one tick from the board or the simulated world.
struct TickSensors : TickReadings {
    uint64_t time_us = 0;  ///< robot clock
    uint32_t faults = 0;   ///< OMNI_FAULT_OVERRUN
    uint32_t overruns = 0; ///< tick overruns since boot
    uint32_t encoder_errors[OMNI_MAX_WHEELS] = {};
    float jitter_us = 0.0f; ///< TickJitter::max_us(); 0 in hardware-in-the-loop
};

class ControlLoop {
public:
    /// Restart core, driver and requests. The latest setup is kept, and so is an e-stop, in which the first tick
    /// starts. Only while no tick can run.
    void restart();
    /// Stop in the next tick, before everything else. Any context. @param events OMNI_EVENT_DISARM, OMNI_EVENT_ESTOP or
    /// both.
    void stop(uint32_t events) { set_pending(events); }
    /// Are these stops still pending?
    bool stopping(uint32_t events) const { return (flags_.load(std::memory_order_relaxed) & events) != 0; }
    /// Background: hold the pose from the next tick on (OMNI_EVENT_TRAJECTORY_STOP); earlier setpoints are void.
    void hold();
    /// Background: start a pin test in the next tick; if that is not possible and motors are driven, disarm.
    void request_pin_test(uint32_t ticks, bool release);
    /// Background: set the setpoint for the next tick.
    void set_setpoint(const omni_setpoint_t &setpoint);
    /// Background: set the arrival time of the latest relevant heartbeat, robot clock.
    void set_heartbeat(uint64_t time_us);
    /// Background: queue a pose fix. @return false if the queue is full.
    bool offer_fix(const omni_pose_fix_t &fix);
    /// Background: queue a request. @return false if the queue is full.
    bool request(Request request);
    bool request_event(uint32_t events);

    /// Run one control tick. @param wires hardware of the motors. @param stopwatch measures the tick's duration.
    void tick(const TickSensors &sensors, MotorWires &wires, Clock &stopwatch);
    /// Switch these motors off. @return false if it could not be sent now: call again.
    bool release(MotorWires &wires);

    /// Background: start an excitation in the next tick, and a prepared burst. All zero: end the running one.
    void excite(const omni_excitation_t &excitation);

    Mailbox<RobotSetup> setups;
    Mailbox<omni_trajectory_t> plans;
    Snapshot<TickReport> report;
    BurstRecorder burst;            ///< records `report`
    Snapshot<FixReport> fix_report; ///< result of the latest fix, published one tick after it

private:
    struct OrderedSetpoint {
        omni_setpoint_t setpoint{};
        uint32_t order = 0;
    };

    void set_pending(uint32_t flags) { flags_.fetch_or(flags, std::memory_order_release); }
    void process_pending();
    void process_events(uint32_t flags);
    void process_requests();
    void process_pending_data(uint32_t flags);
    void start_pending_excitation();
    void process_fix();
    void report_fix();
    void process_plan();
    void apply(const Request &request);
    void forget_setpoints(uint32_t before);
    void use_wiring(MotorWires &wires);
    void drive(MotorWires &wires, uint64_t now_us);
    void publish(const TickSensors &sensors, I2cBus &bus);

    const RobotSetup *setup_ = nullptr;
    omni_robot_t robot_{};
    omni_inputs_t inputs_{};
    omni_outputs_t *outputs_ = &report.writing().outputs; ///< outputs of the last tick, within the report's write slot
    MotorDrivers drivers_;
    MotorDriver *driver_ = &drivers_.of(0); ///< driver in use
    I2cScan scan_;
    PinTester pin_tester_;
    bool driver_was_ready_ = false;
    bool powered_ = false; ///< output enable is on
    /// Flags for the next tick beside omni_event_t: which inputs are pending.
    enum PendingFlags : uint32_t {
        pending_excitation = 1u << 26,
        pending_request = 1u << 27,
        pending_fix = 1u << 28,
        pending_pin_test = 1u << 29,
        pending_heartbeat = 1u << 30,
        pending_setpoint = 1u << 31
    };
    std::atomic<uint32_t> flags_{0};                 ///< omni_event_t and PendingFlags
    std::atomic<uint32_t> setpoints_void_before_{0}; ///< order of the latest hold()
    Snapshot<OrderedSetpoint> setpoints_;
    Snapshot<uint64_t> heartbeats_;
    Snapshot<omni_excitation_t> excitations_;
    Queue<omni_pose_fix_t, 2> fixes_;
    Queue<Request, 32> requests_;
    uint32_t order_ = 0;        ///< background: incremented by each request and hold()
    uint32_t oldest_valid_ = 0; ///< tick: order of the oldest valid setpoint
    VoltageIntegral voltages_;
    TickDuration duration_;
    uint32_t ticks_ = 0;
    bool had_fix_ = false;         ///< the previous tick had a fix
    uint32_t fixes_seen_ = 0;      ///< number of fixes processed
    uint32_t accepted_before_ = 0; ///< the pose filter's counters before the tick with the fix
    uint32_t refused_before_ = 0;
    float nis_before_ = 0.0f;
};

} // namespace omni
