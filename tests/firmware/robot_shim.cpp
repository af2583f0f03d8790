// SPDX-License-Identifier: MIT
// extern "C" access to the whole firmware on a board of fakes. It has simulated time, four serial ports, a PWM chip,
// wheels that turn as they are driven. All of it is plain memory, so that a moment can be kept and gone back to.
#include <algorithm>
#include <cstring>
#include <iterator>
#include <new>
#include <optional>
#include <utility>

#include "app/app.h"
#include "chip.h"
#include "frames.h"

namespace {

constexpr size_t all_ports = omni::Board::max_ports;

struct TestClock final : omni::Clock {
    uint64_t us = 0;
    uint64_t now_us() override { return us; }
    uint64_t stopwatch_ns() override { return us * 1000; }
};

struct Wheels final : omni::Encoders {
    int64_t turned[OMNI_MAX_WHEELS] = {}; ///< 1/4096 counts
    uint8_t read(int32_t *counts) override {
        for (size_t i = 0; i < OMNI_MAX_WHEELS; ++i) {
            counts[i] = static_cast<int32_t>(turned[i] / 4096);
        }
        return (1u << OMNI_MAX_WHEELS) - 1;
    }
    void errors(uint32_t *errors) override { std::fill(errors, errors + OMNI_MAX_WHEELS, 0u); }
};

struct TestBus final : omni::I2cBus {
    fuzz::Chip chip;
    bool busy = false;
    uint32_t busy_polls = 0; ///< for which it stays busy
    uint32_t refusals = 0;   ///< batches that it does not take
    uint8_t answer[omni::I2cTransaction::max_read] = {};
    uint32_t recoveries = 0;
    bool submit(const omni::I2cTransaction *batch, size_t count) override {
        if (refusals > 0) {
            --refusals;
            return false;
        }
        for (size_t i = 0; i < count; ++i) {
            chip.transact(batch[i].address, batch[i].write, batch[i].write_length, answer, batch[i].read_length);
        }
        busy = true;
        return true;
    }
    omni::I2cStatus poll(uint8_t *read) override {
        if (busy && busy_polls > 0) {
            --busy_polls;
            return omni::I2cStatus::busy;
        }
        std::memcpy(read, answer, sizeof answer);
        const bool done = busy;
        busy = false;
        return done ? omni::I2cStatus::done : omni::I2cStatus::idle;
    }
    void recover() override { ++recoveries; }
};

/// Motor pins of every kind of bridge.
struct TestPins final : omni::MotorPins {
    bool lost = false; ///< the timers lose their settings in every tick
    omni::MotorPinSteps steps[OMNI_MAX_WHEELS];
    bool serves_driver(uint8_t) override { return true; }
    bool set_steps(const omni::MotorPinSteps *wanted, size_t wheels) override {
        std::copy(wanted, wanted + wheels, steps);
        return !lost;
    }
};

struct TestPin final : omni::OutputEnable {
    bool on = false;
    bool wired() override { return true; }
    void set(bool to) override { on = to; }
};

struct TestButton final : omni::StopButton {
    bool pressed = false;
    bool open() override { return pressed; }
};

/// Chips that only have troubles.
struct TestGyro final : omni::GyroChip {
    omni::GyroTrouble now;
    void use_axis(int8_t) override {}
    uint8_t read(uint64_t, float *) override { return 0; }
    omni::GyroTrouble trouble() const override { return now; }
};

struct TestFlow final : omni::FlowChip {
    omni::FlowTrouble now;
    void use(bool) override {}
    uint8_t read(uint64_t, float *, bool) override { return 0; }
    omni::FlowTrouble trouble() const override { return now; }
};

struct TestPort final : omni::SerialPort {
    uint8_t in[16384] = {};
    size_t in_length = 0;
    uint8_t out[16384] = {};
    size_t out_length = 0;
    size_t piece = sizeof in; ///< bytes per read
    uint32_t connection = 1;
    size_t read(uint8_t *data, size_t capacity) override {
        const size_t count = connection == 0 ? 0 : std::min({in_length, capacity, piece});
        std::memcpy(data, in, count);
        in_length -= count;
        std::memmove(in, in + count, in_length);
        return count;
    }
    size_t write_space() override { return sizeof out - out_length; }
    bool write(const uint8_t *data, size_t length) override {
        if (length > write_space()) {
            return false;
        }
        std::memcpy(out + out_length, data, length);
        out_length += length;
        return true;
    }
    uint32_t session() override { return connection; }
    bool radio = false;
    bool is_radio() override { return radio; }
};

struct TestStorage final : omni::Storage {
    uint8_t bytes[2048] = {};
    size_t writes_left = SIZE_MAX; ///< bytes until the power fails
    bool unreadable = false;
    size_t written = 0;
    size_t size() override { return sizeof bytes; }
    bool read(size_t offset, uint8_t *data, size_t length) override {
        std::memcpy(data, bytes + offset, length);
        return !unreadable;
    }
    bool write(size_t offset, const uint8_t *data, size_t length) override {
        const size_t count = std::min(length, writes_left);
        std::memcpy(bytes + offset, data, count);
        writes_left -= writes_left == SIZE_MAX ? 0 : count;
        written += count;
        return count == length;
    }
};

struct TestWatchdog final : omni::Watchdog {
    omni::ResetCause cause = omni::ResetCause::power_on;
    void feed() override {}
    omni::ResetCause reset_cause() override { return cause; }
    const char *lines[3] = {}; ///< what the fault handler has kept
    const char *crash_line(size_t number) override { return lines[number]; }
    void reset() override {}
};

omni_real_t full_battery() {
    return 12.0f;
}

} // namespace

struct TestRobot {
    bool lockstep = false;
    TestClock clock;
    Wheels wheels;
    TestBus bus;
    TestPin pin;
    TestButton button;
    TestGyro gyro;
    TestFlow flow;
    TestPort ports[all_ports];
    TestStorage storage;
    TestWatchdog watchdog;
    TestPins pins;
    bool has_pins = false;
    alignas(8) uint8_t burst_memory[4096];
    omni::Board board;
    std::optional<omni::App> app;
    fuzz::Chip hil_chip;
    uint8_t hil_read[8] = {};
    uint8_t hil_read_length = 0;
    uint64_t hil_us = 0;
    uint32_t hil_sequence = 0;
    uint8_t hil_enabled = 0;
    bool hil_button = false;

    void boot();
    bool driven(const fuzz::Chip &chip, bool enabled) const;
    void turn(const fuzz::Chip &chip, bool enabled);
    void take_actuators(const uint8_t *bytes, size_t length);
};

void TestRobot::boot() {
    board = omni::Board{};
    board.clock = &clock;
    board.burst_memory = burst_memory;
    board.burst_bytes = sizeof burst_memory;
    board.encoders = &wheels;
    board.i2c = &bus;
    board.output_enable = &pin;
    board.stop_button = &button;
    board.gyro_chip = &gyro;
    board.flow_chip = &flow;
    board.storage = &storage;
    board.watchdog = &watchdog;
    board.motor_pins = has_pins ? &pins : nullptr;
    board.robot_values = omni_builtin_robots[omni_builtin_robot_find("three_wheel")].values;
    board.battery_V = full_battery;
    for (size_t i = 0; i < all_ports; ++i) {
        board.ports[i] = &ports[i];
        ports[i].radio = i == 1;
        ports[i].in_length = ports[i].out_length = 0;
    }
    board.port_count = all_ports;
    clock.us = 0;
    pin.on = false;
    bus.busy = false;
    app.emplace(board, lockstep);
}

/// Of the bridge: full forward is 4096.
static int drive_of(const omni_real_t *values, const fuzz::Chip &chip, size_t wheel) {
    const auto in1 = static_cast<size_t>(values[OMNI_PARAM_W1_IN1_CH + wheel]);
    const auto in2 = static_cast<size_t>(values[OMNI_PARAM_W1_IN2_CH + wheel]);
    return static_cast<int>(chip.high_steps(in1)) - static_cast<int>(chip.high_steps(in2));
}

/// 1/4096 counts per tick of a wheel at full duty, by the robot's own motor parameters. Quicker ones would be too fast
/// for what they are asked for, and the robot would stop.
static omni_real_t full_speed(const omni_real_t *values) {
    const omni_real_t constant = values[OMNI_PARAM_MOT_K];
    const omni_real_t friction = values[OMNI_PARAM_MOT_R] * values[OMNI_PARAM_MOT_B];
    const omni_real_t rad_s = values[OMNI_PARAM_BAT_V_NOM] * constant / (friction + constant * constant);
    return 4096.0f * rad_s * values[OMNI_PARAM_ENC_CPR] / 6.2831853f * static_cast<omni_real_t>(OMNI_TICK_US) * 1e-6f;
}

bool TestRobot::driven(const fuzz::Chip &chip, bool enabled) const {
    bool any = false;
    for (size_t i = 0; i < static_cast<size_t>(board.robot_values[OMNI_PARAM_WHEELS]); ++i) {
        any = any || drive_of(board.robot_values, chip, i) != 0;
    }
    return any && enabled;
}

void TestRobot::turn(const fuzz::Chip &chip, bool enabled) {
    const omni_real_t full = full_speed(board.robot_values);
    for (size_t i = 0; i < OMNI_MAX_WHEELS; ++i) {
        const omni_real_t duty = static_cast<omni_real_t>(drive_of(board.robot_values, chip, i)) / 4096.0f;
        wheels.turned[i] += enabled ? static_cast<int64_t>(full * duty) : 0;
    }
}

void TestRobot::take_actuators(const uint8_t *bytes, size_t length) {
    for (size_t at = 0; at < length;) {
        const fuzz::Found frame = fuzz::frame_at(bytes, length, at);
        if (frame.kind == fuzz::Found::Kind::valid && frame.id == MAVLINK_MSG_ID_OMNI_HIL_ACTUATORS) {
            mavlink_omni_hil_actuators_t message{};
            std::memcpy(&message, frame.payload, std::min(frame.payload_length, sizeof message));
            hil_enabled = message.output_enable;
            hil_read_length = 0;
            for (size_t i = 0; i < message.i2c_length; i += 3u + message.i2c[i + 1]) {
                const uint8_t *it = message.i2c + i;
                const uint8_t reads = it[2 + it[1]];
                hil_chip.transact(it[0], it + 2, it[1], hil_read, reads);
                hil_read_length = reads;
            }
        }
        at += frame.kind == fuzz::Found::Kind::valid ? frame.length : 1;
    }
}

extern "C" {

/// @param lockstep as App's. @return nullptr without memory.
TestRobot *robot_new(bool lockstep) {
    auto *robot = new (std::nothrow) TestRobot;
    if (robot != nullptr) {
        robot->lockstep = lockstep;
        std::memset(robot->storage.bytes, 0xFF, sizeof robot->storage.bytes);
        robot->bus.chip.power_up();
        robot->hil_chip.power_up();
        robot->boot();
    }
    return robot;
}

void robot_delete(TestRobot *robot) {
    delete robot;
}

size_t robot_size() {
    return sizeof(TestRobot);
}

/// Power or only the processor comes back; the PWM chip keeps what it was told unless its power went, too.
void robot_reset(TestRobot *robot, int cause, bool power) {
    robot->watchdog.cause = static_cast<omni::ResetCause>(cause);
    if (power) {
        robot->bus.chip.power_up();
    }
    robot->boot();
}

void robot_send(TestRobot *robot, size_t port, const uint8_t *bytes, size_t length) {
    TestPort &it = robot->ports[port];
    const size_t count = std::min(length, sizeof it.in - it.in_length);
    std::memcpy(it.in + it.in_length, bytes, count);
    it.in_length += count;
}

/// What the robot has sent since the last call. @return count of bytes.
size_t robot_take(TestRobot *robot, size_t port, uint8_t *bytes, size_t capacity) {
    TestPort &it = robot->ports[port];
    const size_t count = std::min(it.out_length, capacity);
    std::memcpy(bytes, it.out, count);
    it.out_length = 0;
    return count;
}

size_t robot_unread(const TestRobot *robot, size_t port) {
    return robot->ports[port].in_length;
}

/// The timer's tick, a millisecond after the last.
void robot_tick(TestRobot *robot) {
    robot->clock.us += OMNI_TICK_US;
    robot->app->tick();
    robot->turn(robot->bus.chip, robot->pin.on);
}

void robot_pass(TestRobot *robot) {
    robot->app->background();
}

/// Time without ticks, as in lockstep or behind a save.
void robot_wait(TestRobot *robot, uint64_t us) {
    robot->clock.us += us;
}

/// The host in the loop: sensors to a port; what comes back is the world's.
void robot_hil_sensors(TestRobot *robot, size_t port) {
    mavlink_omni_hil_sensors_t message{};
    robot->hil_us += OMNI_TICK_US;
    message.time_us = robot->hil_us;
    message.sequence = ++robot->hil_sequence;
    robot->wheels.read(message.counts);
    message.counts_valid = 0x0F;
    message.battery_voltage = 12.0f;
    message.i2c_read_length = robot->hil_read_length;
    message.stop_button = robot->hil_button ? 1 : 0;
    std::memcpy(message.i2c_read, robot->hil_read, sizeof robot->hil_read);
    uint8_t payload[256] = {};
    std::memcpy(payload, &message, sizeof message);
    fuzz::Bytes frame;
    fuzz::append_frame(&frame, *fuzz::entry_of(MAVLINK_MSG_ID_OMNI_HIL_SENSORS), payload, fuzz::Form{});
    robot_send(robot, port, frame.data(), frame.size());
}

void robot_hil_actuators(TestRobot *robot, size_t port) {
    robot->take_actuators(robot->ports[port].out, robot->ports[port].out_length);
    robot->turn(robot->hil_chip, robot->hil_enabled == 1);
}

/// A new host in the loop.
void robot_hil_restart(TestRobot *robot) {
    robot->hil_us = 0;
    robot->hil_read_length = 0;
    robot->hil_chip.power_up();
    robot->hil_enabled = 0;
}

/// Some motor gets voltage. @param hil of the simulated robot.
bool robot_driven(const TestRobot *robot, bool hil) {
    return hil ? robot->driven(robot->hil_chip, robot->hil_enabled == 1)
               : robot->driven(robot->bus.chip, robot->pin.on);
}

/// The output-enable pin lets the chip's outputs through.
bool robot_enabled(const TestRobot *robot, bool hil) {
    return hil ? robot->hil_enabled == 1 : robot->pin.on;
}

/// The chip's outputs would drive some motor.
bool robot_has_duty(const TestRobot *robot, bool hil) {
    return robot->driven(hil ? robot->hil_chip : robot->bus.chip, true);
}

bool robot_reboot_wanted(const TestRobot *robot) {
    return robot->app->reboot_wanted();
}

/// @param piece bytes per read(). @param connection 0: nobody.
void robot_port(TestRobot *robot, size_t port, size_t piece, uint32_t connection) {
    robot->ports[port].piece = piece;
    robot->ports[port].connection = connection;
}

/// The bus stays busy for so many polls, and refuses so many batches. @return how often it was to be freed before.
uint32_t robot_bus_busy(TestRobot *robot, uint32_t polls, uint32_t refusals) {
    robot->bus.busy_polls = polls;
    robot->bus.refusals = refusals;
    return std::exchange(robot->bus.recoveries, 0u);
}

/// Every encoder tells as many counts at once, as one that is disturbed does.
void robot_counts_jump(TestRobot *robot, int32_t counts) {
    for (int64_t &turned : robot->wheels.turned) {
        turned += int64_t{counts} * 4096;
    }
}

/// What the board says of the crash before the next reset: two lines.
void robot_crash_lines(TestRobot *robot, const char *first, const char *second) {
    robot->watchdog.lines[0] = first;
    robot->watchdog.lines[1] = second;
}

/// From the next reset on the board has motor pins. @param lost their timers lose their settings in every tick.
void robot_pins(TestRobot *robot, bool lost) {
    robot->has_pins = true;
    robot->pins.lost = lost;
}

/// Some motor pin is high for a part of the period.
bool robot_pins_high(const TestRobot *robot) {
    return std::any_of(std::begin(robot->pins.steps), std::end(robot->pins.steps),
                       [](const omni::MotorPinSteps &it) { return it.first != 0 || it.second != 0; });
}

/// Press the stop button, or cut its wire. @param hil the simulated robot's.
void robot_press(TestRobot *robot, bool pressed, bool hil) {
    (hil ? robot->hil_button : robot->button.pressed) = pressed;
}

/// Causes of the chips' troubles, as GyroCause and FlowCause count them.
void robot_sensor_trouble(TestRobot *robot, uint8_t gyro, uint8_t flow) {
    robot->gyro.now.cause = static_cast<omni::GyroCause>(gyro);
    robot->flow.now.cause = static_cast<omni::FlowCause>(flow);
}

uint8_t *robot_storage(TestRobot *robot) {
    return robot->storage.bytes;
}

size_t robot_storage_written(const TestRobot *robot) {
    return robot->storage.written;
}

void robot_storage_fate(TestRobot *robot, size_t writes_left, bool unreadable) {
    robot->storage.writes_left = writes_left;
    robot->storage.unreadable = unreadable;
}
}
