// SPDX-License-Identifier: MIT
/// @file main.cpp  Measures the firmware's control tick (ControlLoop::tick: requests, core, PWM chip, report) and the
/// core's part of it on an emulated Cortex-M7. Prints two lines per case, "core" and "tick". Each has name, mean and
/// largest number of instructions, and the deepest that the stack got below the caller of ControlLoop::tick.
#include <cstdio>
#include <cstring>
#include <new>

#include "app/tick/control_loop.h"
#include "base/stack.h"
#include "cases.h"
#include "meter.h"

extern "C" {
#include "../program/world.h"

// The linker puts the second in the place of the first: --wrap=omni_robot_tick.
void __real_omni_robot_tick(omni_robot_t *robot, const omni_inputs_t *inputs, omni_outputs_t *outputs);
void __wrap_omni_robot_tick(omni_robot_t *robot, const omni_inputs_t *inputs, omni_outputs_t *outputs);
}

namespace {

constexpr uint32_t warm_up_ticks = 400; ///< the power-up of the PWM chip, arming, the first fixes
constexpr uint32_t measured_ticks = 640;

alignas(8) uint8_t burst_memory[omni::default_burst_bytes];

struct Figure {
    uint64_t sum = 0;
    uint32_t largest = 0;
    void add(uint32_t count) {
        sum += count;
        largest = count > largest ? count : largest;
    }
    uint32_t mean() const { return static_cast<uint32_t>((sum + measured_ticks / 2) / measured_ticks); }
};

bool core_watched = false; ///< measuring the core costs the whole tick a little: one run for each
uint32_t core_instructions = 0;

/// Takes everything and has done it by the next tick.
class Bus final : public omni::I2cBus {
public:
    bool submit(const omni::I2cTransaction *, size_t) override {
        status_ = omni::I2cStatus::done;
        return true;
    }
    omni::I2cStatus poll(uint8_t *read) override {
        read[0] = 0x20; // MODE1 of a chip that is awake
        return status_;
    }
    void recover() override {}

private:
    omni::I2cStatus status_ = omni::I2cStatus::idle;
};

class Pin final : public omni::OutputEnable {
public:
    bool wired() override { return true; }
    void set(bool) override {}
};

/// Counters are read by a function of about this size on a real board too.
class Stopwatch final : public omni::Clock {
public:
    uint64_t now_us() override { return 0; }
    uint64_t stopwatch_ns() override { return 0; }
};

class Bench {
public:
    explicit Bench(const Case &c) : case_(c) {}
    bool prepare();
    bool run();
    const Figure &figure() const { return figure_; }
    size_t depth() const { return an500::stack_used() - depth_before_; }

private:
    void ask(uint64_t now_us);
    void tell_fix();
    void read_flow(omni::TickSensors &sensors);
    void tick(uint64_t now_us, bool counted);

    const Case &case_;
    omni::ControlLoop loop_;
    const omni_robot_config_t *config_ = nullptr;
    world_t world_{};
    omni_real_t theta_ = 0.0f; ///< heading of the tick before
    omni_pose_t read_{};       ///< at the last reading of the motion over the floor
    random_t random_{};
    uint32_t tick_ = 0;
    Bus bus_;
    Pin pin_;
    omni::MotorWires wires_{bus_, pin_, nullptr};
    Stopwatch stopwatch_;
    Figure figure_;           ///< of the core if it is watched, else of the whole tick
    size_t depth_before_ = 0; ///< of the stack when ControlLoop::tick is called
};

bool Bench::prepare() {
    const int32_t robot = omni_builtin_robot_find(case_.robot);
    omni_real_t values[OMNI_PARAM_COUNT];
    std::memcpy(values, omni_builtin_robots[robot].values, sizeof values);
    for (size_t i = 0; i < case_.settings_used; ++i) {
        values[case_.settings[i].parameter] = case_.settings[i].value;
    }
    omni::RobotSetup &setup = loop_.setups.scratch();
    int32_t bad = -1;
    if (omni::make_robot_setup(setup, values, &bad) != OMNI_OK) {
        return false;
    }
    config_ = &setup.config;
    loop_.setups.publish();
    loop_.restart();
    if (case_.burst) {
        loop_.burst.attach(burst_memory, sizeof burst_memory);
        const omni::BurstPlan plan{warm_up_ticks + measured_ticks, 1, omni::burst_all_signals, 0x07};
        if (!loop_.burst.prepare(plan, *config_)) {
            return false;
        }
        loop_.burst.trigger();
    }
    omni_trajectory_t &plan = loop_.plans.scratch();
    const omni_pose_t origin{};
    if (omni_trajectory_plan(&plan, &config_->trajectory, &config_->kinematics, nullptr, &origin) != OMNI_OK) {
        return false;
    }
    plan.timing.lead_in_us = 0;
    world_reset(&world_, &random_, &plan.start);
    read_ = plan.start;
    omni::Request request;
    request.kind = omni::Request::Kind::set_pose;
    request.pose = plan.start;
    return loop_.request(request);
}

/// What a ground station sends: a heartbeat a second, set-points at 50 Hz.
void Bench::ask(uint64_t now_us) {
    if (tick_ % 1000 == 1) {
        loop_.set_heartbeat(now_us);
    }
    if (case_.setpoint != OMNI_SETPOINT_TRAJECTORY && tick_ % 20 == 0) {
        omni_setpoint_t setpoint{};
        setpoint.kind = case_.setpoint;
        setpoint.time_us = now_us;
        setpoint.pose = {0.4f, 0.3f, 1.0f};
        setpoint.twist = {0.08f, 0.02f, 0.1f};
        loop_.set_setpoint(setpoint);
    }
    if (tick_ == (case_.gyro ? 360 : 100)) { // a gyro learns its bias first
        loop_.request_event(OMNI_EVENT_ARM);
    }
    if (tick_ == (case_.gyro ? 362 : 102) && case_.setpoint == OMNI_SETPOINT_TRAJECTORY) {
        loop_.plans.publish();
    }
}

void Bench::tell_fix() {
    if (case_.fix_period == 0 || tick_ % case_.fix_period != 7 || tick_ <= case_.fix_age) {
        return;
    }
    omni_pose_fix_t fix{};
    fix.pose = world_pose(&world_, case_.fix_age, &fix.time_us);
    fix.pose.x += 0.004f * random_normal(&random_);
    fix.pose.y += 0.004f * random_normal(&random_);
    fix.pose.theta += 0.004f * random_normal(&random_);
    loop_.offer_fix(fix);
}

/// Motion over the floor since the reading before, in body axes of mid-way, with noise.
void Bench::read_flow(omni::TickSensors &sensors) {
    if (!case_.flow || tick_ % 20 != 7) {
        return;
    }
    const omni_pose_t &now = world_.pose;
    const omni_real_t turned = omni_wrap_pi(now.theta - read_.theta);
    omni_real_t sine;
    omni_real_t cosine;
    omni_sincosf(now.theta - 0.5f * turned, &sine, &cosine);
    const omni_real_t dx = now.x - read_.x;
    const omni_real_t dy = now.y - read_.y;
    sensors.flow_moved[0] = cosine * dx + sine * dy + 1e-4f * random_normal(&random_);
    sensors.flow_moved[1] = cosine * dy - sine * dx + 1e-4f * random_normal(&random_);
    sensors.flow_moved[2] = turned;
    sensors.flow_valid = OMNI_FLOW_XY | OMNI_FLOW_TURN | OMNI_FLOW_RECEIVED;
    read_ = now;
}

void Bench::tick(uint64_t now_us, bool counted) {
    omni::TickSensors sensors;
    sensors.time_us = now_us;
    std::memcpy(sensors.counts, world_.counts, sizeof sensors.counts);
    sensors.counts_valid = 0x0F;
    sensors.battery_V = 12.0f;
    if (case_.gyro) {
        const omni_real_t turned = omni_wrap_pi(world_.pose.theta - theta_);
        theta_ = world_.pose.theta;
        sensors.gyro_rad_s[2] = turned * 1000.0f + 0.002f * random_normal(&random_);
        sensors.gyro_valid = 7;
    }
    read_flow(sensors);
    depth_before_ = an500::stack_depth();
    const uint32_t begin = meter::timer();
    loop_.tick(sensors, wires_, stopwatch_);
    const uint32_t end = meter::timer();
    if (counted) {
        figure_.add(core_watched ? core_instructions : meter::between(begin, end));
    }
}

bool Bench::run() {
    const omni_outputs_t *out = &loop_.report.reading().outputs;
    uint64_t now_us = 1000;
    for (tick_ = 0; tick_ < warm_up_ticks + measured_ticks; ++tick_) {
        now_us += OMNI_TICK_US;
        world_step(&world_, config_, out->voltage_V, now_us);
        ask(now_us);
        tell_fix();
        tick(now_us, tick_ >= warm_up_ticks);
        loop_.report.update();
        out = &loop_.report.reading().outputs;
        if (tick_ >= warm_up_ticks && out->state != OMNI_STATE_ARMED) {
            std::printf("%s: not armed in tick %u, faults %x\n", case_.name, static_cast<unsigned>(tick_),
                        static_cast<unsigned>(out->fault_history));
            return false;
        }
    }
    return true;
}

/// Measure a case, the core or the whole tick, and print its figures.
bool measure(const Case &c, bool core) {
    static uint8_t memory alignas(Bench)[sizeof(Bench)];
    auto *bench = new (memory) Bench(c);
    core_watched = core;
    if (!bench->prepare()) {
        return false;
    }
    an500::repaint_stack();
    if (!bench->run()) {
        return false;
    }
    const size_t depth = bench->depth();
    std::printf("%s %s %u %u %u\n", core ? "core" : "tick", c.name, static_cast<unsigned>(bench->figure().mean()),
                static_cast<unsigned>(bench->figure().largest), static_cast<unsigned>(depth));
    return true;
}

} // namespace

void __wrap_omni_robot_tick(omni_robot_t *robot, const omni_inputs_t *inputs, omni_outputs_t *outputs) {
    if (!core_watched) {
        __real_omni_robot_tick(robot, inputs, outputs);
        return;
    }
    const uint32_t begin = meter::timer();
    __real_omni_robot_tick(robot, inputs, outputs);
    core_instructions = meter::between(begin, meter::timer());
}

namespace {

/// Bytes of the structs that make up most of the tick's memory.
void print_sizes() {
    std::printf("omni_robot_t %u\n", static_cast<unsigned>(sizeof(omni_robot_t)));
    std::printf("omni_robot_config_t %u\n", static_cast<unsigned>(sizeof(omni_robot_config_t)));
    std::printf("omni_trajectory_t %u\n", static_cast<unsigned>(sizeof(omni_trajectory_t)));
    std::printf("ControlLoop %u\n", static_cast<unsigned>(sizeof(omni::ControlLoop)));
}

} // namespace

int main(int argc, char **argv) {
    if (argc > 1 && std::strcmp(argv[1], "--sizes") == 0) {
        print_sizes();
        return 0;
    }
    meter::start();
    for (size_t i = 0; i < case_count; ++i) {
        if (!measure(cases[i], true) || !measure(cases[i], false)) {
            return 1;
        }
    }
    return 0;
}
