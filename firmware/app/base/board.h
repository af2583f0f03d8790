// SPDX-License-Identifier: MIT
/// @file board.h  Hardware abstraction: small interfaces that firmware/boards/* implements. The application uses
/// nothing else.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/base/flow_chip.h"
#include "app/base/gyro_chip.h"
#include "omni/board_readings_gen.h"
#include "omni/types.h"

namespace omni {

/// Monotonic time since boot. Callable from the tick and from the background.
class Clock {
public:
    virtual uint64_t now_us() = 0;
    /// Free-running fine counter [ns], for measuring durations only.
    virtual uint64_t stopwatch_ns() = 0;

protected:
    ~Clock() = default;
};

/// Wheel encoders: raw 32-bit counters that may wrap.
class Encoders {
public:
    /// Read all counters at once, once per tick. @param counts OMNI_MAX_WHEELS entries. @return bit per wheel: its
    /// count is valid.
    virtual uint8_t read(int32_t *counts) = 0;
    /// Illegal transitions (both channels changed at once) since boot. @param errors OMNI_MAX_WHEELS entries; 0 where
    /// the decoder cannot detect them.
    virtual void errors(uint32_t *errors) = 0;

protected:
    ~Encoders() = default;
};

/// Outcome of the transactions submitted to an I2C bus.
enum class I2cStatus : uint8_t {
    idle,  ///< nothing was submitted since the last poll
    busy,  ///< still on the wire
    done,  ///< all acknowledged
    nack,  ///< no acknowledge
    stuck, ///< a line is held low
};

/// One I2C transaction: a write, then an optional read after a repeated START.
struct I2cTransaction {
    static constexpr size_t max_write = 40;
    static constexpr size_t max_read = 28;
    uint8_t address = 0;      ///< 7 bit
    uint8_t write_length = 0; ///< 0..max_write; 0 and nothing to read: address only, to probe for a device
    uint8_t read_length = 0;  ///< 0..max_read
    uint8_t write[max_write] = {};
};

/// Counters of an I2C bus since boot.
struct I2cStats {
    uint32_t nacks = 0;
    uint32_t timeouts = 0;
    uint32_t recoveries = 0;
    uint16_t last_us = 0; ///< time on the wire of the last batch; 0: not measured
};

/// Asynchronous I2C master. Called from the tick only; never waits.
class I2cBus {
public:
    /// Queue a batch; its transactions are joined by repeated START and end with one STOP, so the chip updates at once.
    /// @return false if the last batch is still busy (nothing is queued).
    virtual bool submit(const I2cTransaction *batch, size_t count) = 0;
    /// Result of the last batch; `read` gets max_read bytes of its last read. nack, stuck and done are reported once.
    virtual I2cStatus poll(uint8_t *read) = 0;
    /// Timeout after which poll() no longer reports the last batch as busy [us]. 0: the bus has no timeout.
    virtual uint32_t max_busy_us() { return 0; }
    /// Start freeing a stuck bus (nine clocks, STOP) without waiting.
    virtual void recover() = 0;
    virtual I2cStats stats() { return {}; }

protected:
    ~I2cBus() = default;
};

/// Output-enable pin of the PWM chip or the bridges: removes motor power independently of the motor driver. Off (motors
/// coast) after reset.
class OutputEnable {
public:
    /// False: the pin is not wired, and the motors can be stopped through the driver only.
    virtual bool wired() = 0;
    /// Called from the tick, in every tick.
    virtual void set(bool on) = 0;
    /// Make the pin high impedance, as in reset, until the next set(), so that its pull-up acts alone. Boards without
    /// that drive it to off.
    virtual void release() { set(false); }

protected:
    ~OutputEnable() = default;
};

/// High time of a wheel's two motor pins per PWM period, 0 (always low) .. 4096 (always high).
struct MotorPinSteps {
    uint16_t first = 0;
    uint16_t second = 0;
};

/// PWM on the processor's pins, for motor drivers without a PWM chip. All low after reset and after a crash.
class MotorPins {
public:
    /// Are the pins wired to bridges of this kind? @param driver omni_mot_driver.
    virtual bool serves_driver(uint8_t driver) = 0;
    /// Called from the tick. @param steps one entry per wheel.
    /// @return false if a pin's timer has lost its settings; they are then written again.
    virtual bool set_steps(const MotorPinSteps *steps, size_t wheels) = 0;

protected:
    ~MotorPins() = default;
};

/// A stop button: a normally-closed contact from a pulled-up pin to ground, so that a cut wire reads as pressed.
class StopButton {
public:
    /// Current level, not debounced. Called from the tick, in every tick, and from the background.
    /// @return true: pressed, or a broken wire.
    virtual bool open() = 0;

protected:
    ~StopButton() = default;
};

/// A byte stream to a ground station or host. Used from the background only; never waits.
class SerialPort {
public:
    /// Read received bytes. @return number of bytes put into `data`.
    virtual size_t read(uint8_t *data, size_t capacity) = 0;
    /// @return free space of the transmit buffer [bytes].
    virtual size_t write_space() = 0;
    /// Write all bytes or none. @return false if there was no room.
    virtual bool write(const uint8_t *data, size_t length) = 0;
    /// Number of the current connection: increases with each new one, 0 while disconnected. A radio is always 1.
    virtual uint32_t session() = 0;
    /// The port is a radio: with a key set, frames must be signed. LINK2_BAUD applies to radio ports, LINK2_LEGACY to
    /// the first of them.
    virtual bool is_radio() { return false; }
    /// Has the port a baud rate that set_baud() changes?
    virtual bool has_baud() { return false; }
    /// Set the baud rate [bit/s]. Bytes written before are still sent at the old one.
    virtual void set_baud(uint32_t) {}

protected:
    ~SerialPort() = default;
};

/// Non-volatile bytes, erased state 0xFF. Used from the background only, and only while disarmed.
class Storage {
public:
    virtual size_t size() = 0;
    virtual bool read(size_t offset, uint8_t *data, size_t length) = 0;
    /// Atomic: a power failure meanwhile leaves all of the old bytes or all of the new ones. @return false on failure.
    virtual bool write(size_t offset, const uint8_t *data, size_t length) = 0;
    /// It may contain data that cannot be read: the last write was cut short, or all of it reads as erased but is not.
    virtual bool may_hold_unreadable_data() { return false; }

protected:
    ~Storage() = default;
};

/// Why the processor started.
enum class ResetCause : uint8_t {
    power_on,
    watchdog,
    software, ///< requested, or by the loader after an upload
    crash,
    over_temperature,
};

/// Resets the processor unless fed.
class Watchdog {
public:
    virtual void feed() = 0;
    virtual ResetCause reset_cause() = 0;
    /// Crash report of the fault handler before the last reset, in lines of at most 50 characters. nullptr: no such
    /// line.
    virtual const char *crash_line(size_t number) = 0;
    /// Reset now (MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN).
    virtual void reset() = 0;

protected:
    ~Watchdog() = default;
};

/// Status LED.
class StatusLight {
public:
    virtual void set(bool on) = 0;

protected:
    ~StatusLight() = default;
};

/// Memory never used since boot (high-water mark) [bytes]; 0: not known.
struct MemoryFree {
    uint32_t stack = 0;
    uint32_t heap = 0;
};

/// 1.8 s of every signal of four wheels, a sample per tick.
constexpr size_t default_burst_bytes = size_t{192} * 1024;

/// Interfaces and properties of a board. It calls its use_NAME() of BoardReadings.
struct Board : BoardReadings {
    static constexpr size_t max_ports = 4;
    Clock *clock = nullptr;
    Encoders *encoders = nullptr;
    I2cBus *i2c = nullptr;
    OutputEnable *output_enable = nullptr;
    MotorPins *motor_pins = nullptr;   ///< nullptr: none
    StopButton *stop_button = nullptr; ///< nullptr: none
    GyroChip *gyro_chip = nullptr;     ///< nullptr: none
    FlowChip *flow_chip = nullptr;     ///< nullptr: none
    StatusLight *light = nullptr;      ///< nullptr: none
    SerialPort *ports[max_ports] = {}; ///< port 0: USB; port 1: radio
    size_t port_count = 0;
    Storage *storage = nullptr;
    Watchdog *watchdog = nullptr;
    uint64_t serial_number = 0;                ///< unique serial number; 0: none
    uint32_t wiring_id = 0;                    ///< hash of the wiring compiled in; 0: none
    const omni_real_t *robot_values = nullptr; ///< parameter defaults of the robot file, OMNI_PARAM_COUNT entries
    /// Supply voltage [V], or <= 0 if the board doesn't measure it.
    omni_real_t (*battery_V)() = nullptr;
    /// Memory for bursts (burst_recorder.h), aligned to 8 bytes, uninitialised. nullptr: no burst recording.
    uint8_t *burst_memory = nullptr;
    size_t burst_bytes = 0;
    /// nullptr: not known. Called from the background.
    MemoryFree (*memory_free)() = nullptr;
};

} // namespace omni
