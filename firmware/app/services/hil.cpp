// SPDX-License-Identifier: MIT
#include "app/services/hil.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>

#include "app/link/mavlink_types.h"

namespace omni {

bool HilBus::submit(const I2cTransaction *batch, size_t count) {
    size_t length = 0;
    for (size_t i = 0; i < count; ++i) {
        length += 3u + batch[i].write_length;
    }
    if (submitted_ || length > capacity) {
        return false;
    }
    length_ = 0;
    for (size_t i = 0; i < count; ++i) {
        const I2cTransaction &transaction = batch[i];
        bytes_[length_++] = transaction.address;
        bytes_[length_++] = transaction.write_length;
        std::memcpy(bytes_ + length_, transaction.write, transaction.write_length);
        length_ = static_cast<uint8_t>(length_ + transaction.write_length);
        bytes_[length_++] = transaction.read_length;
    }
    submitted_ = true;
    return true;
}

I2cStatus HilBus::poll(uint8_t *read) {
    std::memcpy(read, read_, sizeof read_);
    const I2cStatus status = status_;
    status_ = I2cStatus::idle;
    return status;
}

void HilBus::restart() {
    length_ = 0;
    submitted_ = false;
    status_ = I2cStatus::idle;
    stats_ = {};
}

void HilBus::answer(uint8_t status, const uint8_t *read) {
    if (!submitted_) {
        return;
    }
    submitted_ = false;
    status_ = (status & 2) != 0 ? I2cStatus::stuck : ((status & 1) != 0 ? I2cStatus::nack : I2cStatus::done);
    stats_.timeouts += status_ == I2cStatus::stuck ? 1 : 0;
    stats_.nacks += status_ == I2cStatus::nack ? 1 : 0;
    std::memcpy(read_, read, sizeof read_);
}

uint8_t HilBus::take(uint8_t *out) {
    const uint8_t length = length_;
    std::memcpy(out, bytes_, length);
    length_ = 0;
    return length;
}

bool HilMotorPins::set_steps(const MotorPinSteps *steps, size_t wheels) {
    std::copy(steps, steps + wheels, steps_);
    return true;
}

void Hil::restart() {
    bus.restart();
    motor_pins.restart();
    output_enable.set(false);
    heard_ = false;
    button_open_ = false;
    host_sleeps_ = false;
}

void Hil::take(const Frame &frame, TickSensors *sensors) {
    const auto message = frame.as<mavlink_omni_hil_sensors_t>();
    sequence_ = message.sequence;
    heard_ = true;
    button_open_ = message.stop_button != 0;
    host_sleeps_ = message.host_sleeps != 0;
    sensors->time_us = message.time_us;
    sensors->from_message(message);
    bus.answer(message.i2c_status, message.i2c_read);
}

/// PWM steps as sent by every driver; the output enable decides whether they reach the motors. Voltages are in the
/// wheel's direction, duties in the motor's.
void Hil::report_bridges(const omni_outputs_t &out, mavlink_omni_hil_actuators_t *message) const {
    const bool on = out.drive && output_enable.level() == 1;
    for (size_t i = 0; i < OMNI_MAX_WHEELS; ++i) {
        const omni_bridge_counts_t bridge = omni_bridge_counts(out.duty[i], on);
        const int steps = std::abs(static_cast<int>(bridge.in1) - static_cast<int>(bridge.in2));
        message->duty[i] = static_cast<int16_t>(out.voltage_V[i] < 0.0f ? -steps : steps);
        message->coast = static_cast<uint8_t>(message->coast | (on ? 0u : 1u << i));
    }
}

void Hil::answer(const omni_outputs_t &out, Link &link) {
    mavlink_omni_hil_actuators_t message{};
    message.time_us = out.time_us;
    message.sequence = sequence_;
    message.reference[0] = out.reference.pose.x;
    message.reference[1] = out.reference.pose.y;
    message.reference[2] = out.reference.pose.theta;
    message.pose[0] = out.pose.x;
    message.pose[1] = out.pose.y;
    message.pose[2] = out.pose.theta;
    std::copy(out.wheel_reference, out.wheel_reference + OMNI_MAX_WHEELS, message.wheel_reference);
    message.wheel_scale = out.wheel_scale;
    message.duty_scale = out.duty_scale;
    message.faults = out.faults;
    message.config_sequence = out.config_sequence;
    message.state = out.state;
    message.phase = static_cast<uint8_t>(out.reference.phase);
    message.output_enable = output_enable.level();
    report_bridges(out, &message);
    message.i2c_length = bus.take(message.i2c);
    for (size_t i = 0; i < OMNI_MAX_WHEELS; ++i) {
        message.motor_pins[2 * i] = motor_pins.steps()[i].first;
        message.motor_pins[2 * i + 1] = motor_pins.steps()[i].second;
    }
    link.send(MAVLINK_MSG_ID_OMNI_HIL_ACTUATORS, message, Priority::reply);
}

} // namespace omni
