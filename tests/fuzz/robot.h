// SPDX-License-Identifier: MIT
/// @file robot.h  The firmware on a board made of fakes at the chip's pins, and what must hold whatever reaches it.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "app/app.h"
#include "app/drivers/otos.h"
#include "app/drivers/register_flow.h"
#include "chip.h"
#include "frames.h"
#include "script.h"

namespace fuzz {

struct FakeClock final : omni::Clock {
    uint64_t us = 0;
    uint64_t ns = 0;
    uint64_t now_us() override { return us; }
    uint64_t stopwatch_ns() override { return ns += 1000; }
};

struct FakeEncoders final : omni::Encoders {
    int32_t counts[OMNI_MAX_WHEELS] = {};
    uint8_t valid = 0x0F;
    uint32_t illegal = 0;
    uint8_t read(int32_t *to) override;
    void errors(uint32_t *to) override;
};

struct FakeBus final : omni::I2cBus {
    Chip chip;
    omni::I2cStatus fate = omni::I2cStatus::done; ///< of every batch from now on
    bool submit(const omni::I2cTransaction *batch, size_t count) override;
    omni::I2cStatus poll(uint8_t *read) override;
    void recover() override {}

private:
    bool busy_ = false;
    bool foreign_ = false; ///< what is on the wire is for nobody here
    uint8_t read_[omni::I2cTransaction::max_read] = {};
};

/// A bus with an OTOS that creeps, and does not see the floor now and then. What the motors' bus suffers, it does, too.
class FlowBus final : public omni::I2cBus {
public:
    explicit FlowBus(const FakeBus &motors) : motors_(motors) {}
    bool submit(const omni::I2cTransaction *batch, size_t count) override;
    omni::I2cStatus poll(uint8_t *read) override;
    void recover() override {}

private:
    const FakeBus &motors_;
    uint32_t reads_ = 0;
    bool identity_ = false; ///< the batch asks who it is
};

struct FakePin final : omni::OutputEnable {
    bool is_wired = true;
    bool is_on = false;
    bool wired() override { return is_wired; }
    void set(bool on) override { is_on = on; }
};

/// Two PWM pins per motor, and the bridges of one kind behind them. The robot on the bench has them if its wiring says
/// so.
struct FakeMotorPins final : omni::MotorPins {
    uint8_t driver = OMNI_MOT_DRIVER_PCA9685; ///< omni_mot_driver
    bool works = true;                        ///< false: the timers lose their settings in every tick
    omni::MotorPinSteps steps[OMNI_MAX_WHEELS];
    bool serves_driver(uint8_t asked) override { return asked == driver; }
    bool set_steps(const omni::MotorPinSteps *to, size_t wheels) override;
    /// All are low, as after a reset.
    void restart() { std::fill(steps, steps + OMNI_MAX_WHEELS, omni::MotorPinSteps{}); }
    bool all_off() const;
};

struct FakePort final : omni::SerialPort {
    Bytes in;  ///< still to be read by the robot
    Bytes out; ///< sent by the robot and not yet looked at
    size_t piece = 64;
    size_t space = 1 << 16;
    uint32_t connection = 1;
    uint32_t connections = 1;
    size_t read(uint8_t *data, size_t capacity) override;
    size_t write_space() override { return connection != 0 ? space : 0; }
    bool write(const uint8_t *data, size_t length) override;
    uint32_t session() override { return connection; }
    bool radio = false;
    bool is_radio() override { return radio; }
};

struct FakeStorage final : omni::Storage {
    static constexpr size_t capacity = 2048;
    uint8_t bytes[capacity] = {};
    size_t used = capacity;
    size_t writes_left = SIZE_MAX; ///< bytes until the power fails
    size_t size() override { return used; }
    bool read(size_t offset, uint8_t *data, size_t length) override;
    bool write(size_t offset, const uint8_t *data, size_t length) override;
};

struct FakeWatchdog final : omni::Watchdog {
    omni::ResetCause cause = omni::ResetCause::power_on;
    void feed() override {}
    omni::ResetCause reset_cause() override { return cause; }
    const char *crash_line(size_t number) override;
    void reset() override {}
};

/// Gets to know what the robot says, in its order.
class Listener {
public:
    virtual void heard(size_t port, const Found &frame) = 0;
    /// A tick of host-in-the-loop is over: what it did to the motors of that world can be seen.
    virtual void host_ticked() = 0;

protected:
    ~Listener() = default;
};

/// The robots that scripts choose from. More may be built in; fuzz.py builds in the one with motor pins.
constexpr const char *robots[] = {"fast_three_wheel", "four_wheel", "three_wheel_pins", "three_wheel"};

/// How a run is set up.
struct Setup {
    bool lockstep = false;
    bool may_arm = false; ///< the script may send valid arm commands
    bool only_nonsense =
        false; ///< every floating-point field is NaN or infinite, wheels stand still: nothing may be driven
    const char *robot = robots[0]; ///< name of a built-in robot
    uint8_t ports = 1;
};

class Robot {
public:
    Robot(const Setup &setup, Script &script);

    const Setup setup;
    FakeClock clock;
    FakeEncoders encoders;
    FakeBus bus;
    FakePin pin;
    FakeMotorPins motor_pins;
    FakePort ports[omni::Board::max_ports];
    FakeStorage storage;
    FakeWatchdog watchdog;

    /// What the robot measures from now on [V]. Of all robots: the board's function takes no argument.
    static void set_battery(float volts);
    /// Power up (again).
    void boot();
    /// Bytes for a port; whether they ask to arm is noted.
    void send(size_t port, const Bytes &bytes);
    /// One timer tick, and sometimes what the background does after it.
    void tick();
    /// The background until every byte is read, a few passes at most.
    void background();
    void connect_anew(size_t port, bool gone);
    /// Turn every wheel on by as many counts in the direction it is driven: a plant of the simplest kind.
    void turn_wheels(int counts);
    /// A correct OMNI_HIL_SENSORS for the next tick of the host's clock.
    Bytes hil_sensors(const Form &form = {});

    /// Some bridge of the bench is switched on: the chip says so, and the output-enable pin (where it is wired) lets
    /// it. Or the motor pins say so, which nothing stands behind.
    bool bench_moves() const;
    /// The same of the host's world, as of the last OMNI_HIL_ACTUATORS.
    bool world_moves() const;

    Listener *listener = nullptr;
    bool hosted = false; ///< the wheels turn in the host's world
    uint64_t timer_ticks = 0;
    uint64_t host_ticks = 0;
    uint64_t boots = 0;
    uint64_t hil_us = 1000;
    float hil_battery_V = 12.0f;

private:
    void look(size_t port);
    void take_frame(size_t port, const Found &frame);
    void take_actuators(const Found &frame);
    /// What a world's motors hang on.
    struct Motors {
        const Chip &chip;
        const FakeMotorPins &pins;
        bool all_off() const { return chip.all_off() && pins.all_off(); }
    };
    Motors bench() const { return {bus.chip, motor_pins}; }
    Motors world() const { return {hil_chip_, hil_pins_}; }
    void check_motors(const Motors &motors, const char *promise);
    bool drives(const Motors &motors) const;
    /// Of the bridge: full forward is 4096.
    int drive_of(const Motors &motors, size_t wheel) const;
    void note_arming(size_t port, const Bytes &bytes);

    alignas(8) uint8_t burst_memory_[4096];
    FlowBus flow_bus_{bus};
    std::optional<omni::RegisterFlow> flow_;
    std::array<float, OMNI_PARAM_COUNT> own_values_{};
    omni::Board board_;
    std::optional<omni::App> app_;
    Chip hil_chip_;
    FakeMotorPins hil_pins_;
    bool hil_power_ = false;
    uint8_t hil_read_[8] = {};
    uint32_t hil_sequence_ = 0;
    Bytes tail_[omni::Board::max_ports]; ///< end of what a port got, for frames that come in pieces
    bool arming_asked_ = false;
};

} // namespace fuzz
