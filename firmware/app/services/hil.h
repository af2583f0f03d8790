// SPDX-License-Identifier: MIT
/// @file hil.h  Hardware-in-the-loop: sensors from OMNI_HIL_SENSORS; I2C bus and pins to OMNI_HIL_ACTUATORS.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "app/base/board.h"
#include "app/link/link.h"
#include "app/link/mavlink_types.h"
#include "app/tick/control_loop.h"

namespace omni {

/// Captures the driver's I2C writes of a tick; their result arrives with the next tick's sensors.
class HilBus final : public I2cBus {
public:
    bool submit(const I2cTransaction *batch, size_t count) override;
    I2cStatus poll(uint8_t *read) override;
    void recover() override {} ///< the simulated bus recovers by itself
    I2cStats stats() override { return stats_; }

    void restart();
    /// Set the result of the last tick's transactions. @param status bit 0: not acknowledged, bit 1: stuck.
    void answer(uint8_t status, const uint8_t *read);
    /// Take this tick's bytes. @param out capacity of OMNI_HIL_ACTUATORS.i2c. @return their count.
    uint8_t take(uint8_t *out);

private:
    static constexpr size_t capacity = 128;
    uint8_t bytes_[capacity] = {};
    uint8_t length_ = 0;
    bool submitted_ = false;
    I2cStatus status_ = I2cStatus::idle;
    I2cStats stats_;
    uint8_t read_[I2cTransaction::max_read] = {};
};

/// Simulated output-enable pin. The simulated world knows whether it is wired.
class HilOutputEnable final : public OutputEnable {
public:
    bool wired() override { return true; }
    void set(bool on) override { level_ = on ? 1 : 0; }
    void release() override { level_ = 2; }
    /// As in OMNI_HIL_ACTUATORS.output_enable.
    uint8_t level() const { return level_; }

private:
    uint8_t level_ = 0;
};

/// Simulated PWM pins. The simulated world knows which are wired, and to what.
class HilMotorPins final : public MotorPins {
public:
    bool serves_driver(uint8_t) override { return true; }
    bool set_steps(const MotorPinSteps *steps, size_t wheels) override;
    void restart() { std::fill(steps_, steps_ + OMNI_MAX_WHEELS, MotorPinSteps{}); }
    /// As in OMNI_HIL_ACTUATORS.motor_pins.
    const MotorPinSteps *steps() const { return steps_; }

private:
    MotorPinSteps steps_[OMNI_MAX_WHEELS];
};

/// Connection to one simulated world.
class Hil {
public:
    HilBus bus;
    HilOutputEnable output_enable;
    HilMotorPins motor_pins;
    MotorWires wires{bus, output_enable, &motor_pins};

    void restart();
    /// Decode the sensors of one tick. The core checks that time advances.
    void take(const Frame &frame, TickSensors *sensors);
    /// Send the actuators of the tick just run, as the last frame on the link.
    void answer(const omni_outputs_t &out, Link &link);
    /// Have sensors been received since the restart?
    bool has_sensors() const { return heard_; }
    /// Stop button in the latest sensors.
    bool button_open() const { return button_open_; }
    /// The host sleeps while it waits for the answer (flag of the latest sensors).
    bool host_sleeps() const { return host_sleeps_; }

private:
    void report_bridges(const omni_outputs_t &out, mavlink_omni_hil_actuators_t *message) const;

    bool heard_ = false;
    bool button_open_ = false;
    bool host_sleeps_ = false;
    uint32_t sequence_ = 0;
};

} // namespace omni
