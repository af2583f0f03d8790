// SPDX-License-Identifier: MIT
#include "bench.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "app/base/core.h"
#include "check.h"

namespace soak {
namespace {

using fuzz::check;

fuzz::Script nothing(nullptr, 0);

fuzz::Setup setup_of(const char *robot) {
    fuzz::Setup setup;
    setup.may_arm = true;
    setup.robot = robot;
    setup.ports = links;
    return setup;
}

constexpr uint64_t beat_ms = 1000;
constexpr uint64_t radio_every = 5; ///< of five pose fixes one comes over the radio
constexpr double most_error_m = 0.05;

} // namespace

Bench::Bench(const char *name, const State &state)
    : robot(setup_of(name), nothing), station(robot, state.signing_time), world_(state.world) {
    std::memcpy(robot.storage.bytes, state.storage, sizeof state.storage);
    robot.boot();
}

State Bench::state(uint64_t hour) const {
    State state;
    state.hour = hour;
    state.signing_time = station.signing_time();
    std::memcpy(state.storage, robot.storage.bytes, sizeof state.storage);
    state.world = world_;
    return state;
}

/// NED over USB, compact over the radio.
void Bench::pass_fix(const hil_sensors_t &sensors) {
    const uint64_t age_us = sensors.time_us - sensors.fix.taken_us;
    const uint64_t taken_us = robot.clock.us - std::min(age_us, robot.clock.us);
    const hil_real_t *pose = sensors.fix.pose;
    if (++fixes_ % radio_every == 0) {
        mavlink_omni_pose_fix_t fix{};
        fix.time_boot_ms = static_cast<uint32_t>(taken_us / 1000);
        fix.x_mm = static_cast<int16_t>(std::lround(pose[0] * 1e3));
        fix.y_mm = static_cast<int16_t>(std::lround(pose[1] * 1e3));
        fix.theta_mrad10 = static_cast<int16_t>(std::lround(pose[2] * 1e4));
        station.send(radio, MAVLINK_MSG_ID_OMNI_POSE_FIX, fix);
    } else {
        mavlink_vicon_position_estimate_t fix{};
        fix.usec = taken_us;
        fix.x = static_cast<float>(pose[0]);
        fix.y = static_cast<float>(-pose[1]);
        fix.yaw = static_cast<float>(-pose[2]);
        fix.covariance[0] = __builtin_nanf("");
        station.send(usb, MAVLINK_MSG_ID_VICON_POSITION_ESTIMATE, fix);
    }
}

void Bench::actuate() {
    hil_steps_t in1[HIL_MAX_WHEELS] = {};
    hil_steps_t in2[HIL_MAX_WHEELS] = {};
    for (uint32_t i = 0; i < world_.config.wheels; ++i) {
        in1[i] = static_cast<hil_steps_t>(robot.bus.chip.high_steps(static_cast<size_t>(world_.config.in1_channel[i])));
        in2[i] = static_cast<hil_steps_t>(robot.bus.chip.high_steps(static_cast<size_t>(world_.config.in2_channel[i])));
    }
    hil_world_bridge(&world_, in1, in2);
    hil_world_output_enable(&world_, robot.pin.is_on ? HIL_OE_ON : HIL_OE_OFF);
}

/// What the robot last said about its pose beside the truth.
void Bench::compare() {
    if (station.trackings == trackings_ || ticks_ < compare_from_) {
        return;
    }
    trackings_ = station.trackings;
    const double error = std::hypot(static_cast<double>(station.tracking.pose[0]) - world_.pose[0],
                                    static_cast<double>(station.tracking.pose[1]) - world_.pose[1]);
    error_m_max = std::max(error_m_max, error);
    check(error <= most_error_m, "the estimate stays with the truth (mm)", std::lround(error * 1e3));
}

void Bench::tick() {
    hil_sensors_t sensors;
    hil_world_sense(&world_, &sensors);
    std::copy(sensors.counts, sensors.counts + OMNI_MAX_WHEELS, robot.encoders.counts);
    fuzz::Robot::set_battery(static_cast<float>(sensors.battery_V));
    if (sensors.has_fix && !sensors.fix.dropped) {
        pass_fix(sensors);
    }
    if (beats && ticks_ % beat_ms == 0) {
        station.heartbeat(usb);
        station.heartbeat(radio);
    }
    robot.tick();
    actuate();
    hil_world_step(&world_, OMNI_TICK_US);
    robot.background();
    station.tick();
    compare();
    distance_m_ += std::hypot(world_.twist[0], world_.twist[1]) * 1e-3;
    ++ticks_;
}

void Bench::run(double seconds) {
    for (auto left = static_cast<uint64_t>(seconds * 1000.0); left > 0; --left) {
        tick();
    }
}

void Bench::command(size_t link, uint16_t number, float first, float second, float third) {
    station.command(link, number, first, second, third);
    while (station.waits()) {
        tick(); // a second at most: the station ends the process then
    }
}

void Bench::start(size_t link) {
    command(usb, MAV_CMD_OMNI_SET_POSE, static_cast<float>(world_.pose[0]), static_cast<float>(world_.pose[1]),
            static_cast<float>(std::remainder(world_.pose[2], 6.283185307179586)));
    command(link, MAV_CMD_OMNI_TRAJECTORY_START, -1.0f, -1.0f);
    command(link, MAV_CMD_COMPONENT_ARM_DISARM, 1.0f);
    run(0.1);
    check(armed(), "the robot is armed 0.1 s after it was asked to (MAV_STATE)", station.state);
    compare_from_ = ticks_ + 1000;
}

void Bench::disarm(size_t link) {
    compare_from_ = UINT64_MAX;
    command(link, MAV_CMD_COMPONENT_ARM_DISARM, 0.0f);
    run(0.1);
    check(station.state == MAV_STATE_STANDBY, "the robot is disarmed 0.1 s after it was asked to (MAV_STATE)",
          station.state);
}

void Bench::jump(uint64_t us) {
    robot.clock.us += us;
    robot.clock.ns += us * 1000;
}

} // namespace soak
