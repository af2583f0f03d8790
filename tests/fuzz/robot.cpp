// SPDX-License-Identifier: MIT
#include "robot.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "check.h"

namespace fuzz {
namespace {

float battery_now = 12.0f;

float battery_V() {
    return battery_now;
}

/// Every floating-point field of a message is finite, but for those that MAVLink wants to be NaN.
void check_finite(const Found &frame) {
    if (frame.id == MAVLINK_MSG_ID_ODOMETRY) {
        return; // velocity_covariance[0]
    }
    const mavlink_message_info_t *info = mavlink_get_message_info_by_id(frame.id);
    check(info != nullptr, "messages are of the dialect", static_cast<long>(frame.id));
    uint8_t whole[256] = {};
    std::memcpy(whole, frame.payload, frame.payload_length);
    for (unsigned i = 0; i < info->num_fields; ++i) {
        const mavlink_field_info_t &field = info->fields[i];
        for (unsigned k = 0; field.type == MAVLINK_TYPE_FLOAT && k < std::max(field.array_length, 1u); ++k) {
            float value = 0.0f;
            std::memcpy(&value, whole + field.wire_offset + 4 * k, sizeof value);
            check(std::isfinite(value), "what the robot says is finite (message * 100 + field)",
                  static_cast<long>(frame.id * 100 + i));
        }
    }
}

} // namespace

uint8_t FakeEncoders::read(int32_t *to) {
    std::copy(counts, counts + OMNI_MAX_WHEELS, to);
    return valid;
}

void FakeEncoders::errors(uint32_t *to) {
    std::fill(to, to + OMNI_MAX_WHEELS, illegal);
}

bool FakeBus::submit(const omni::I2cTransaction *batch, size_t count) {
    if (busy_ && fate == omni::I2cStatus::busy) {
        return false; // otherwise the last batch is through by now, whether somebody asked or not
    }
    busy_ = true;
    foreign_ = count > 0 && batch[0].address != Chip::address;
    for (size_t i = 0; i < count && fate == omni::I2cStatus::done; ++i) {
        chip.transact(batch[i].address, batch[i].write, batch[i].write_length, read_, batch[i].read_length);
    }
    return true;
}

omni::I2cStatus FakeBus::poll(uint8_t *read) {
    std::memcpy(read, read_, sizeof read_);
    if (!busy_ || fate == omni::I2cStatus::busy) {
        return busy_ ? omni::I2cStatus::busy : omni::I2cStatus::idle;
    }
    busy_ = false;
    return foreign_ && fate == omni::I2cStatus::done ? omni::I2cStatus::nack : fate;
}

bool FlowBus::submit(const omni::I2cTransaction *batch, size_t count) {
    check(count == 1, "a sensor's bus carries one transfer at a time", static_cast<long>(count));
    identity_ = batch[0].read_length == 1 && batch[0].write[0] == omni::otos::reg_product_id;
    return motors_.fate != omni::I2cStatus::busy;
}

omni::I2cStatus FlowBus::poll(uint8_t *read) {
    constexpr uint32_t blind_every = 64;
    constexpr uint32_t whole_turn = 1u << 16; // of its position's 16 bits, whose ends are at 10 m
    ++reads_;
    read[0] = identity_ ? omni::otos::product_id : reads_ % blind_every == 0 ? omni::otos::warn_optical : uint8_t{0};
    for (size_t axis = 0; axis < 3; ++axis) {
        const uint32_t steps = reads_ * (3 + axis) % whole_turn;
        read[1 + 2 * axis] = static_cast<uint8_t>(steps & 0xFF);
        read[2 + 2 * axis] = static_cast<uint8_t>(steps >> 8);
    }
    return motors_.fate;
}

bool FakeMotorPins::set_steps(const omni::MotorPinSteps *to, size_t wheels) {
    check(wheels <= OMNI_MAX_WHEELS, "there are so many wheels", static_cast<long>(wheels));
    for (size_t i = 0; i < wheels; ++i) {
        check(to[i].first <= OMNI_PWM_STEPS && to[i].second <= OMNI_PWM_STEPS,
              "no pin is high for longer than a period", static_cast<long>(i));
        steps[i] = to[i];
    }
    return works;
}

bool FakeMotorPins::all_off() const {
    return std::all_of(steps, steps + OMNI_MAX_WHEELS,
                       [](const omni::MotorPinSteps &wheel) { return wheel.first == 0 && wheel.second == 0; });
}

size_t FakePort::read(uint8_t *data, size_t capacity) {
    if (connection == 0) {
        return 0;
    }
    const size_t count = std::min({in.size(), capacity, piece});
    std::copy_n(in.begin(), count, data);
    in.erase(in.begin(), in.begin() + static_cast<std::ptrdiff_t>(count));
    figures().bytes += count;
    return count;
}

bool FakePort::write(const uint8_t *data, size_t length) {
    check(length <= write_space(), "no more is written than there is room", static_cast<long>(length));
    out.insert(out.end(), data, data + length);
    return true;
}

bool FakeStorage::read(size_t offset, uint8_t *data, size_t length) {
    if (offset > used || length > used - offset) {
        return false;
    }
    std::memcpy(data, bytes + offset, length);
    return true;
}

bool FakeStorage::write(size_t offset, const uint8_t *data, size_t length) {
    if (offset > used || length > used - offset) {
        return false;
    }
    const size_t count = std::min(length, writes_left);
    std::memcpy(bytes + offset, data, count);
    writes_left -= count;
    return count == length;
}

const char *FakeWatchdog::crash_line(size_t number) {
    return cause == omni::ResetCause::crash && number < 2 ? "a line of fifty characters that the fault handler kept"
                                                          : nullptr;
}

Robot::Robot(const Setup &how, Script &script) : setup(how) {
    storage.used = script.one_in(2) ? 1080 : FakeStorage::capacity;
    std::memset(storage.bytes, 0xFF, sizeof storage.bytes);
    if (!setup.only_nonsense && script.one_in(4)) {
        script.bytes(storage.bytes, script.below(64));
    }
    watchdog.cause = static_cast<omni::ResetCause>(script.below(5));
    pin.is_wired = !script.one_in(4);
    bus.chip.power_up();
    hil_chip_.power_up();
    battery_now = 12.0f;
    boot();
}

void Robot::set_battery(float volts) {
    battery_now = volts;
}

void Robot::boot() {
    ++boots;
    board_ = omni::Board{};
    board_.clock = &clock;
    board_.burst_memory = burst_memory_;
    board_.burst_bytes = sizeof burst_memory_;
    board_.encoders = &encoders;
    board_.i2c = &bus;
    board_.output_enable = &pin;
    board_.storage = &storage;
    board_.watchdog = &watchdog;
    const int32_t number = omni_builtin_robot_find(setup.robot);
    check(number >= 0, "the robot is built in", number);
    std::copy_n(omni_builtin_robots[number].values, OMNI_PARAM_COUNT, own_values_.begin());
    if (own_values_[OMNI_PARAM_WHEELS] > 3.0f) {
        own_values_[OMNI_PARAM_GYRO_AXIS] = 3.0f; // no shipped robot has a gyro; this one does
        own_values_[OMNI_PARAM_FLOW_MODE] = 2.0f; // and a sensor of motion over the floor
        board_.flow_chip = &flow_.emplace(flow_bus_, omni::otos::address, omni::otos::chip);
    }
    board_.robot_values = own_values_.data();
    motor_pins.driver = static_cast<uint8_t>(board_.robot_values[OMNI_PARAM_MOT_DRIVER]);
    motor_pins.restart();
    board_.motor_pins = motor_pins.driver == OMNI_MOT_DRIVER_PCA9685 ? nullptr : &motor_pins;
    board_.battery_V = battery_V;
    for (size_t i = 0; i < setup.ports; ++i) {
        ports[i].out.clear(); // a reboot may cut a frame
        board_.ports[i] = &ports[i];
        ports[i].radio = i == 1;
    }
    board_.port_count = setup.ports;
    clock.us = 0;
    app_.emplace(board_, setup.lockstep);
}

void Robot::note_arming(size_t port, const Bytes &bytes) {
    constexpr size_t longest = 300;
    Bytes &tail = tail_[port];
    tail.insert(tail.end(), bytes.begin(), bytes.end());
    arming_asked_ = arming_asked_ || asks_to_arm(tail.data(), tail.size());
    if (tail.size() > longest) {
        tail.erase(tail.begin(), tail.end() - longest);
    }
}

void Robot::send(size_t port, const Bytes &bytes) {
    if (!setup.may_arm) {
        note_arming(port, bytes);
    }
    ports[port].in.insert(ports[port].in.end(), bytes.begin(), bytes.end());
}

void Robot::tick() {
    clock.us += OMNI_TICK_US;
    clock.ns += 1'000'000;
    motor_pins.works = bus.fate == omni::I2cStatus::done;
    app_->tick();
    ++figures().ticks;
    ++timer_ticks;
    check_motors(bench(), "no motor is driven by the timer's tick");
    figures().armed_ticks += bench().all_off() ? 0 : 1;
    figures().driving_ticks += drives(bench()) ? 1 : 0;
}

void Robot::background() {
    for (int pass = 0; pass < 200; ++pass) {
        app_->background();
        bool waiting = false;
        for (size_t i = 0; i < setup.ports; ++i) {
            look(i);
            waiting = waiting || (ports[i].connection != 0 && !ports[i].in.empty());
        }
        if (!waiting) {
            break;
        }
    }
    check_motors(bench(), "no motor is driven by the background");
    if (app_->reboot_wanted()) {
        watchdog.cause = omni::ResetCause::software;
        boot();
    }
}

void Robot::connect_anew(size_t port, bool gone) {
    FakePort &it = ports[port];
    it.in.clear();
    it.out.clear();
    tail_[port].clear();
    it.connection = gone ? 0 : ++it.connections;
}

/// Motors rest unless a valid command asked to arm, and in any case when everything said was nonsense.
void Robot::check_motors(const Motors &motors, const char *promise) {
    if (!setup.may_arm && !arming_asked_) {
        check(motors.all_off(), promise);
    }
    check(!setup.only_nonsense || !drives(motors), "nonsense drives no motor");
}

int Robot::drive_of(const Motors &motors, size_t wheel) const {
    const omni_real_t *values = board_.robot_values;
    const omni::MotorPinSteps &steps = motors.pins.steps[wheel];
    if (motor_pins.driver == OMNI_MOT_DRIVER_IN1_IN2) {
        return steps.first - steps.second;
    }
    const auto in1 = static_cast<size_t>(values[OMNI_PARAM_W1_IN1_CH + wheel]);
    const auto in2 = static_cast<size_t>(values[OMNI_PARAM_W1_IN2_CH + wheel]);
    return static_cast<int>(motors.chip.high_steps(in1)) - static_cast<int>(motors.chip.high_steps(in2));
}

bool Robot::drives(const Motors &motors) const {
    for (size_t i = 0; i < static_cast<size_t>(board_.robot_values[OMNI_PARAM_WHEELS]); ++i) {
        if (drive_of(motors, i) != 0) {
            return true;
        }
    }
    return false;
}

bool Robot::bench_moves() const {
    return !motor_pins.all_off() || (!bus.chip.all_off() && (!pin.is_wired || pin.is_on));
}

bool Robot::world_moves() const {
    return !hil_pins_.all_off() || (hil_power_ && !hil_chip_.all_off());
}

void Robot::turn_wheels(int counts) {
    const Motors motors = setup.lockstep || hosted ? world() : bench();
    for (size_t i = 0; i < OMNI_MAX_WHEELS; ++i) {
        const int drive = drive_of(motors, i);
        const int by = drive > 0 ? counts : drive < 0 ? -counts : 0;
        encoders.counts[i] =
            static_cast<int32_t>(static_cast<uint32_t>(encoders.counts[i]) + static_cast<uint32_t>(by));
    }
}

Bytes Robot::hil_sensors(const Form &form) {
    mavlink_omni_hil_sensors_t message{};
    message.time_us = hil_us;
    message.sequence = ++hil_sequence_;
    std::copy(encoders.counts, encoders.counts + OMNI_MAX_WHEELS, message.counts);
    message.battery_voltage = hil_battery_V;
    message.counts_valid = encoders.valid;
    message.i2c_status = bus.fate == omni::I2cStatus::done ? 0 : 1;
    std::memcpy(message.i2c_read, hil_read_, sizeof hil_read_);
    constexpr uint32_t spread = 2654435761u; // noise: equal readings would be those of a stuck gyro
    const auto noise = static_cast<float>((hil_sequence_ * spread) >> 24);
    std::fill_n(message.gyro_rad_s, std::size(message.gyro_rad_s), 1e-5f * noise);
    message.gyro_valid = 0x7;
    if (hil_sequence_ % 20 == 0) {
        message.flow_moved[0] = 1e-5f * noise; // of a robot that stands
        message.flow_valid = 0xF;
    }
    hil_us += OMNI_TICK_US;
    return frame_of(MAVLINK_MSG_ID_OMNI_HIL_SENSORS, message, form);
}

/// Everything a port has sent must be whole, valid frames one after another; the last may still be on its way.
void Robot::look(size_t port) {
    Bytes &out = ports[port].out;
    size_t at = 0;
    while (at < out.size()) {
        const Found frame = frame_at(out.data(), out.size(), at);
        if (frame.kind == Found::Kind::incomplete) {
            break;
        }
        check(frame.kind == Found::Kind::valid, "the robot sends valid frames and nothing else",
              static_cast<long>(frame.id));
        take_frame(port, frame);
        at += frame.length;
    }
    out.erase(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(at));
}

void Robot::take_frame(size_t port, const Found &frame) {
    ++figures().frames;
    check_finite(frame);
    if (listener != nullptr) {
        listener->heard(port, frame);
    }
    const bool resting = !setup.may_arm && !arming_asked_;
    switch (frame.id) {
    case MAVLINK_MSG_ID_HEARTBEAT:
        check(!resting || (as<mavlink_heartbeat_t>(frame).base_mode & MAV_MODE_FLAG_SAFETY_ARMED) == 0,
              "the robot arms when asked to and not otherwise");
        break;
    case MAVLINK_MSG_ID_OMNI_WHEELS: {
        const auto message = as<mavlink_omni_wheels_t>(frame);
        for (const float duty : message.duty) {
            check(std::fabs(duty) <= 1.0f && (!resting || duty == 0.0f), "duties stay within their limits");
        }
        break;
    }
    case MAVLINK_MSG_ID_OMNI_HIL_ACTUATORS:
        take_actuators(frame);
        break;
    default:
        break;
    }
}

void Robot::take_actuators(const Found &frame) {
    const auto message = as<mavlink_omni_hil_actuators_t>(frame);
    size_t at = 0;
    const size_t length = message.i2c_length;
    check(length <= sizeof message.i2c, "the bus bytes fit their message", static_cast<long>(length));
    while (at < length) {
        const size_t written = message.i2c[at + 1];
        check(at + 3 + written <= length, "transactions are whole", static_cast<long>(at));
        const size_t read = message.i2c[at + 2 + written];
        check(read <= sizeof hil_read_, "no more is read than there is room", static_cast<long>(read));
        hil_chip_.transact(message.i2c[at], message.i2c + at + 2, written, hil_read_, read);
        at += 3 + written;
    }
    for (size_t i = 0; i < OMNI_MAX_WHEELS; ++i) {
        hil_pins_.steps[i] = {message.motor_pins[2 * i], message.motor_pins[2 * i + 1]};
    }
    hil_power_ = message.output_enable == 1;
    ++host_ticks;
    ++figures().ticks;
    figures().armed_ticks += world().all_off() ? 0 : 1;
    figures().driving_ticks += drives(world()) ? 1 : 0;
    check_motors(world(), "no motor is driven by the host's tick");
    if (listener != nullptr) {
        listener->host_ticked();
    }
}

} // namespace fuzz
